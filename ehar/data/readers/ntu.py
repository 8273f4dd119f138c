"""NTU RGB+D 60 and 120: one .skeleton a recording, with the 25 joints of a Kinect for each body that it tracked.

`S001C002P003R002A013.skeleton` is setup 1, camera 2, person 3, replication 2, action 13. Each frame lists its bodies
by their numbers, so a body may come and go. Joints that the Kinect did not track count as lost.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.layouts import NTU25
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.names import matching_files
from ehar.errors import DataError, UsageError

Split = Literal["subject", "view", "setup"]

FPS = 30.0
JOINTS = 25
BODY_NUMBERS = 10  # of a body in a frame, before its joints; the first one names the body
JOINT_NUMBERS = 12  # of a joint: x, y, z, four pixels, a quaternion, whether it is tracked
NOT_TRACKED = 0
MOST_BODIES = 6  # that a Kinect tracks
TRAINING_PEOPLE = {  # cross-subject; those up to 40 are of NTU RGB+D 60
    *(1, 2, 4, 5, 8, 9, 13, 14, 15, 16, 17, 18, 19, 25, 27, 28, 31, 34, 35, 38, 45, 46, 47, 49, 50, 52, 53, 54, 55),
    *(56, 57, 58, 59, 70, 74, 78, 80, 81, 82, 83, 84, 85, 86, 89, 91, 92, 93, 94, 95, 97, 98, 100, 103),
}
TEST_CAMERA = 1  # cross-view: cameras 2 and 3 train
ACTIONS = (
    *("drink water", "eat meal", "brush teeth", "brush hair", "drop", "pick up", "throw", "sit down", "stand up"),
    *("clap", "read", "write", "tear up paper", "put on jacket", "take off jacket", "put on a shoe"),
    *("take off a shoe", "put on glasses", "take off glasses", "put on a hat", "take off a hat", "cheer up"),
    *("wave hand", "kick something", "reach into pocket", "hop", "jump up", "phone call", "play with phone"),
    *("type on a keyboard", "point to something", "take a selfie", "check time", "rub two hands", "nod head"),
    *("shake head", "wipe face", "salute", "put palms together", "cross hands in front", "sneeze or cough"),
    *("stagger", "fall down", "headache", "chest pain", "back pain", "neck pain", "nausea or vomiting", "fan self"),
    *("punch somebody", "kick somebody", "push somebody", "pat on back", "point at somebody", "hug"),
    *("give an object", "touch pocket", "shake hands", "walk towards", "walk apart"),
    *("put on headphone", "take off headphone", "shoot at basket", "bounce ball", "tennis bat swing"),
    *("juggle table tennis balls", "hush", "flick hair", "thumb up", "thumb down", "make ok sign"),
    *("make victory sign", "staple book", "count money", "cut nails", "cut paper", "snap fingers", "open bottle"),
    *("sniff", "squat down", "toss a coin", "fold paper", "ball up paper", "play magic cube", "apply cream on face"),
    *("apply cream on hand", "put on bag", "take off bag", "put something into a bag", "take something out of a bag"),
    *("open a box", "move heavy objects", "shake fist", "throw up cap", "hands up", "cross arms", "arm circles"),
    *("arm swings", "run on the spot", "butt kicks", "cross toe touch", "side kick", "yawn", "stretch oneself"),
    *("blow nose", "hit with something", "wield knife", "knock over", "grab stuff", "shoot with gun", "step on foot"),
    *("high five", "cheers and drink", "carry together", "take a photo", "follow", "whisper", "exchange things"),
    *("support somebody", "rock paper scissors"),
)
OF_TWO = frozenset((*range(50, 61), *range(106, 121)))  # actions of two people
_NAME = re.compile(r"S(?P<setup>\d{3})C(?P<camera>\d{3})P(?P<person>\d{3})R\d{3}A(?P<action>\d{3})")


def prepare_ntu(
    source: str | Path, *, persons: int = 1, split: Split = "subject", unit: str = "m", up: Up = "y"
) -> MotionData:
    """Read the .skeleton files of NTU RGB+D 60 or 120.

    --persons 1 takes the actions of one person, --persons 2 those of two.

    For example:
        ehar data prepare ntu nturgb+d_skeletons ntu.npz --split view
        ehar data prepare ntu nturgb+d_skeletons ntu-two.npz --persons 2

    Args:
        source: folder of the files.
        persons: people of an action: 1 or 2, those who move most.
        split: published split: by subject, by view (camera 1 tests), or by setup (odd ones test).
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        UsageError: an option has a wrong value.
        DataError: a name is not of this set, or a file is malformed.
    """
    if persons not in (1, 2):
        raise UsageError(f"persons: got {persons}, expected 1 or 2")
    if split not in ("subject", "view", "setup"):
        raise UsageError(f"split: got {split!r}, expected subject, view or setup")
    files = matching_files(source, ".skeleton", "the skeletons of NTU RGB+D, such as S001C001P001R001A001.skeleton")
    named = {file: _NAME.fullmatch(file.stem) for file in files}
    for file, match in named.items():
        if match is None or not 1 <= int(match["action"]) <= len(ACTIONS):
            raise DataError(f"{file}: got a name that is not of NTU RGB+D, expected one as S001C001P001R001A001")
    of_these = {
        file: match for file, match in named.items() if match and (int(match["action"]) in OF_TWO) == (persons == 2)
    }
    if not of_these:
        raise DataError(
            f"{source}: got no action of {persons} people; --persons {3 - persons} takes those of {3 - persons}"
        )
    others = len(files) - len(of_these)

    def clips() -> Iterator[Clip]:
        for file, match in of_these.items():
            person, camera, setup = (int(match[what]) for what in ("person", "camera", "setup"))
            tests = {"subject": person not in TRAINING_PEOPLE, "view": camera == TEST_CAMERA, "setup": setup % 2 == 1}
            yield Clip(
                file=file,
                name=file.stem,
                label=ACTIONS[int(match["action"]) - 1],
                motion=upright(read_skeleton(file), unit=unit, up=up, of_camera=True),
                is_test=tests[split],
                subject=person,
                view=camera,
            )

    return assemble(
        clips(),
        name="ntu",
        skeleton=NTU25,
        fps=FPS,
        license="NTU RGB+D: academic research only, on request from ROSE Lab, Nanyang Technological University",
        persons=persons,
        class_order=ACTIONS,
        notes=(f"{others} of {len(files)} files show actions of {3 - persons} people and are left out",)
        if others
        else (),
    )


def read_skeleton(file: Path) -> FloatArray:
    """Return the joints (T, bodies, 25, 3) of one file, in its own unit and axes; NaN where a body is not tracked.

    There is one body at least; it is never seen in a file that tracked nobody.

    Raises:
        DataError: the file is malformed; the error names the frame.
    """
    words = file.read_text(encoding="utf-8", errors="replace").split()
    at = 0

    def count(what: str, least: int, most: int) -> int:
        nonlocal at
        word = words[at] if at < len(words) else "the end of the file"
        at += 1
        if not word.isdecimal() or not least <= int(word) <= most:
            raise DataError(f"{file}: {what}: got {word[:20]}, expected {least} to {most}")
        return int(word)

    def numbers(what: str, amount: int) -> FloatArray:
        nonlocal at
        part = words[at : at + amount]
        at += amount
        if len(part) < amount:
            raise DataError(f"{file}: {what}: ends after {len(part)} of {amount} numbers")
        try:
            return np.array(part, dtype=np.float64)
        except ValueError as error:
            raise DataError(f"{file}: {what}: {error}, expected numbers only") from error

    frames = count("number of frames", 1, 100_000)
    bodies: dict[str, dict[int, FloatArray]] = {}  # by name, then by frame
    for frame in range(frames):
        for body in range(count(f"frame {frame}: number of bodies", 0, MOST_BODIES)):
            what = f"frame {frame}, body {body}"
            name = words[at] if at < len(words) else ""
            numbers(what, BODY_NUMBERS)
            count(f"{what}: number of joints", JOINTS, JOINTS)
            joints = numbers(what, JOINTS * JOINT_NUMBERS).reshape(JOINTS, JOINT_NUMBERS)
            places = joints[:, :3].copy()
            places[joints[:, -1] == NOT_TRACKED] = np.nan
            bodies.setdefault(name, {})[frame] = places
    if at < len(words):
        raise DataError(f"{file}: goes on after the {frames} frames that it announces")
    motion = np.full((frames, max(1, len(bodies)), JOINTS, 3), np.nan)
    for index, seen in enumerate(bodies.values()):
        motion[list(seen), index] = list(seen.values())
    return motion
