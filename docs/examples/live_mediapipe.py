"""MediaPipe's poses for `ehar live`, from a process and an environment of its own.

pip install mediapipe opencv-python, get a pose_landmarker .task file, then
    python live_mediapipe.py --model pose_landmarker_full.task --to 127.0.0.1:5005 --position 6 0 1.5
"""

import argparse
import json
import socket
import time


def message(at, landmarks, width, height, camera, focal_length):
    """Return the line of one image: `landmarks` has 33 (x, y, visibility) in [0, 1] for each person."""
    people = [
        {"keypoints": [[x * width, y * height, min(max(seen, 0.0), 1.0)] for x, y, seen in person]}
        for person in landmarks
    ]
    image = {"width": width, "height": height, "focal_length": focal_length}
    return json.dumps({"time": at, "joints": "mediapipe33", "people": people, "camera": camera, "image": image})


def main():
    """Send what a camera sees until there are no more images."""
    import cv2
    import mediapipe as mp
    from mediapipe.tasks.python import BaseOptions, vision

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", required=True, help="pose_landmarker .task file")
    parser.add_argument("--to", default="127.0.0.1:5005", help="where ehar listens, HOST:PORT")
    parser.add_argument("--video", default="0", help="number of a camera, or a file")
    parser.add_argument("--people", type=int, default=1)
    parser.add_argument("--focal-length", type=float, default=900.0, help="of the camera [px]")
    parser.add_argument("--position", type=float, nargs=3, default=(6.0, 0.0, 1.5), help="of a camera that stays [m]")
    told = parser.parse_args()
    host, port = told.to.rsplit(":", 1)
    camera = {"position": list(told.position)}  # of a drone: ask its autopilot here, for each image
    options = vision.PoseLandmarkerOptions(
        base_options=BaseOptions(model_asset_path=told.model),
        running_mode=vision.RunningMode.VIDEO,
        num_poses=told.people,
    )
    video = cv2.VideoCapture(int(told.video) if told.video.isdigit() else told.video)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with vision.PoseLandmarker.create_from_options(options) as landmarker:
        while True:
            there, image = video.read()
            at = time.monotonic()  # when the image was taken, not when its pose was known
            if not there:
                break
            rgb = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
            found = landmarker.detect_for_video(mp.Image(image_format=mp.ImageFormat.SRGB, data=rgb), int(1000 * at))
            people = found.pose_landmarks
            landmarks = [[(mark.x, mark.y, mark.visibility or 0.0) for mark in person] for person in people]
            height, width = image.shape[:2]
            line = message(at, landmarks, width, height, camera, told.focal_length)
            sender.sendto(line.encode(), (host, int(port)))


if __name__ == "__main__":
    main()
