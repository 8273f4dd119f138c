"""What is changed in the trials of a training, one thing each; there is no torch in this module."""

from dataclasses import dataclass
from typing import Literal

Stream = Literal["joint", "bone", "motion"]
SMOOTHING = 0.1  # as Szegedy et al., CVPR 2016
NEXT_POSE = 1.0  # weight of the loss of the next pose [1 / m^2]


@dataclass(frozen=True)
class Change:
    """How a training differs from the usual one.

    Args:
        weighs: whether the network weighs frames by what they show.
        view: whether it is told where the camera is.
        turning: whether it is also told how the camera turns around people, from frame to frame.
        varied: whether it learns from variations of the motion too.
        trunks: whether it learns from people who are turned at the waist too.
        smoothing: share of the probability that the loss spreads over all classes.
        late: whether frames count in the loss by how many have been seen, or all alike.
        next_pose: weight of a second loss: how far off the next frame's joints are foretold [1 / m^2].
        stream: the part of joints and bones that is left, beside view and partners; None leaves all. "motion" is their
            way from frame to frame.
        pretrained: whether it begins with weights that learned on other data.
        seed: seed of first weights, clips and dropout.
    """

    weighs: bool = True
    view: bool = True
    turning: bool = False
    varied: bool = False
    trunks: bool = False
    smoothing: float = 0.0
    late: bool = True
    next_pose: float = 0.0
    stream: Stream | None = None
    pretrained: bool = False
    seed: int = 0


USUAL = "as it is"
LAST = "last weights"  # no training of its own: the usual one's weights, without their average

# By name; the usual training is made three times.
CHANGES: dict[str, Change] = {
    USUAL: Change(),
    "seed 1": Change(seed=1),
    "seed 2": Change(seed=2),
    "frames alike": Change(weighs=False),
    "view unknown": Change(view=False),
    "turning told": Change(turning=True),
    "varied motion": Change(varied=True),
    "turned trunks": Change(trunks=True),
    "smoothed labels": Change(smoothing=SMOOTHING),
    "loss alike": Change(late=False),
    "next pose": Change(next_pose=NEXT_POSE),
    "joint": Change(stream="joint"),
    "bone": Change(stream="bone"),
    "motion": Change(stream="motion"),
    "pre-trained": Change(pretrained=True),
}


@dataclass(frozen=True)
class Row:
    """A row of the table: trainings whose probabilities are averaged.

    Args:
        name: what it is called.
        trainings: names of `CHANGES`, or `LAST`.
        told: what it is, in a few words.
    """

    name: str
    trainings: tuple[str, ...]
    told: str


ROWS: tuple[Row, ...] = (
    Row(
        USUAL,
        (USUAL,),
        "frames weighed, the view told, late frames ahead in the loss, weights averaged, joints and bones together",
    ),
    Row("frames alike", ("frames alike",), "all frames count as much as evidence"),
    Row("view unknown", ("view unknown",), "polar angle and distance are not told"),
    Row("turning told", ("turning told",), "how the camera turns around people is told too"),
    Row("last weights", (LAST,), "no average over steps"),
    Row(
        "varied motion",
        ("varied motion",),
        "most clips of another pace and size and with other limbs, half mirrored",
    ),
    Row("turned trunks", ("turned trunks",), "most clips of people who are turned at the waist by up to 15 degrees"),
    Row("smoothed labels", ("smoothed labels",), f"{SMOOTHING:g} of the label is spread over all classes"),
    Row("loss alike", ("loss alike",), "all frames count as much in the loss"),
    Row("next pose", ("next pose",), "a second head foretells the next frame's joints"),
    Row("pre-trained", ("pre-trained",), "begins with what the other sets taught"),
    Row("motion beside", (USUAL, "motion"), "a second network sees motion alone; probabilities are averaged"),
    Row("streams fused late", ("joint", "bone", "motion"), "three networks, one for each stream"),
    Row("ensemble of three", (USUAL, "seed 1", "seed 2"), "three of the usual trainings: an upper mark"),
)
