"""RTMPose's poses for `ehar live`, from a process and an environment of its own.

pip install rtmlib onnxruntime opencv-python, then
    python live_rtmpose.py --to 127.0.0.1:5005 --position 6 0 1.5
"""

import argparse
import json
import socket
import time


def message(at, keypoints, scores, width, height, camera, focal_length):
    """Return the line of one image: `keypoints` are (N, 17, 2) [px], `scores` (N, 17)."""
    people = [
        {"keypoints": [[float(x), float(y), min(max(float(seen), 0.0), 1.0)] for (x, y), seen in zip(*person)]}
        for person in zip(keypoints, scores)
    ]
    image = {"width": width, "height": height, "focal_length": focal_length}
    return json.dumps({"time": at, "joints": "coco17", "people": people, "camera": camera, "image": image})


def main():
    """Send what a camera sees until there are no more images."""
    import cv2
    from rtmlib import Body

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--to", default="127.0.0.1:5005", help="where ehar listens, HOST:PORT")
    parser.add_argument("--video", default="0", help="number of a camera, or a file")
    parser.add_argument("--focal-length", type=float, default=900.0, help="of the camera [px]")
    parser.add_argument("--position", type=float, nargs=3, default=(6.0, 0.0, 1.5), help="of a camera that stays [m]")
    told = parser.parse_args()
    host, port = told.to.rsplit(":", 1)
    camera = {"position": list(told.position)}  # of a drone: ask its autopilot here, for each image
    body = Body(mode="lightweight", backend="onnxruntime", device="cpu")
    video = cv2.VideoCapture(int(told.video) if told.video.isdigit() else told.video)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    while True:
        there, image = video.read()
        at = time.monotonic()  # when the image was taken, not when its pose was known
        if not there:
            break
        boxes = body.det_model(image)  # without one, rtmlib would take the whole image for a person
        keypoints, scores = body.pose_model(image, bboxes=boxes) if len(boxes) else ([], [])
        height, width = image.shape[:2]
        line = message(at, keypoints, scores, width, height, camera, told.focal_length)
        sender.sendto(line.encode(), (host, int(port)))


if __name__ == "__main__":
    main()
