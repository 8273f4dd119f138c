"""Which part of the body each joint is, read from the names of joints as data sets and tools write them."""

import re
from collections.abc import Mapping, Sequence

from ehar.data.skeleton import sides

# The stems of names, without the side, without marks and digits. Of several, the first that a skeleton has counts.
_MIDDLE: Mapping[str, Sequence[str]] = {
    "pelvis": ("pelvis", "hips", "hipcenter", "hipcentre", "spinebase", "baseofspine", "midhip", "root", "hip"),
    "spine": ("spine", "spinemid", "midspine", "middleofspine", "torso", "chest", "lowerback", "back", "abdomen"),
    "neck": ("shouldercenter", "shouldercentre", "spineshoulder", "neck", "thorax", "lowerneck"),
    "nose": ("nose", "fhead"),
    "head": ("head", "upperneck", "nose", "fhead"),
}
_FACE: Mapping[str, Sequence[str]] = {"eye": ("eye",), "ear": ("ear", "head")}
_TOE = ("foot", "toes", "toe", "toebase", "bigtoe", "footindex", "smalltoe")
# Three ways to name limbs. Each tells hips and knees in its own words, and so it is known which one a skeleton follows.
_LIMBS: Sequence[Mapping[str, Sequence[str]]] = (
    {  # after joints: Kinect, COCO, SMPL, MediaPipe
        "shoulder": ("shoulder",),
        "elbow": ("elbow",),
        "wrist": ("wrist", "hand"),
        "hand": ("hand", "handtip", "index"),
        "hip": ("hip",),
        "knee": ("knee",),
        "ankle": ("ankle", "heel", "foot"),
        "foot": _TOE,
    },
    {  # after the bone that begins at the joint: most BVH files
        "shoulder": ("upperarm", "uparm", "arm"),
        "elbow": ("lowerarm", "forearm"),
        "wrist": ("hand",),
        "hip": ("upperleg", "upleg", "thigh"),
        "knee": ("lowerleg", "leg", "shin", "calf"),
        "ankle": ("foot",),
        "foot": ("toes", "toe", "toebase", "ball"),
    },
    {  # after the bone that ends at the joint: ASF/AMC files
        "shoulder": ("clavicle",),
        "elbow": ("humerus",),
        "wrist": ("radius", "wrist"),
        "hand": ("hand", "fingers"),
        "hip": ("hipjoint",),
        "knee": ("femur",),
        "ankle": ("tibia",),
        "foot": ("toes", "foot"),
    },
)


def body_parts(joint_names: Sequence[str]) -> dict[str, int]:
    """Return the joint of each part of the body that the names tell, by the part's name.

    Parts are `pelvis`, `spine`, `neck`, `head` and `nose`, and with `left_` or `right_` before them `shoulder`,
    `elbow`, `wrist`, `hand`, `hip`, `knee`, `ankle`, `foot` (its front end), `eye` and `ear`. `neck` is the joint
    between the shoulders. A joint may be two parts, such as a `left_hand` beside no wrist.
    """
    index: dict[tuple[str, str], int] = {}
    for joint, (side, stem) in enumerate(sides(joint_names)):
        index.setdefault((side, re.sub(r"[^a-z]", "", stem)), joint)
    stems = {stem for side, stem in index if side}
    limbs = next((way for way in _LIMBS if stems & set(way["hip"]) and stems & set(way["knee"])), _LIMBS[0])
    found = {}
    for part, words in _MIDDLE.items():
        joints = [index["", word] for word in words if ("", word) in index]
        found.update({part: joints[0]} if joints else {})
    for side in ("left", "right"):
        for part, words in {**limbs, **_FACE}.items():
            joints = [index[side, word] for word in words if (side, word) in index]
            found.update({f"{side}_{part}": joints[0]} if joints else {})
    return found
