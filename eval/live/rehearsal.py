"""A rehearsal: recorded streams, watched and flown around in real time, against the benchmark's record of them."""

import resource
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.batch import Batch
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of
from ehar.data.streams.data import StreamData
from ehar.errors import UsageError
from ehar.planner import Planner
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed
from ehar.viewpoint import AZIMUTH, POLAR, cartesian
from ehar.world import World
from eval.live.figures import LoopFigures
from eval.live.loop import Loop, Said
from eval.live.messages import Answer, CameraPose, Frame, SeenPerson, written
from eval.live.setpoints import LimitShares
from eval.live.watcher import Watcher
from eval.live.weights import live_recogniser
from eval.render.tables import Table
from eval.running.choice import ModelPlace
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from planners.registry import resolve_planner
from planners.value.belief.filters import read_streams
from recognition.setting import Setting, load_recordings_of, load_setting
from recognition.streaming import StreamingRecogniser

LATE = (0.05, 0.3)  # [s] that a late frame takes longer
PACE = 0.01  # [s] between two looks whether the vehicle has come to rest
EQUAL = 1e-3  # of probabilities


@dataclass(frozen=True)
class Rehearsal:
    """What came of a rehearsal.

    Args:
        title: what was rehearsed.
        figures: what the loop did.
        seconds: how long the streams were together [s].
        growth: growth of the process's greatest memory after the first episode [MB]; None after a single episode.
        limits: the greatest share of each limit that setpoints used, by the limit's name.
        lossless: (N,), whether an episode lost no frame.
        same: (N,), the share of frames in which the answer was the benchmark's.
        apart: (N,), the greatest difference to the benchmark's probabilities.
        right: (N,), the share of frames that were right.
        right_there: (N,), the same of the benchmark's.
    """

    title: str
    figures: LoopFigures
    seconds: float
    growth: float | None
    limits: dict[str, float]
    lossless: BoolArray
    same: FloatArray
    apart: FloatArray
    right: FloatArray
    right_there: FloatArray

    def tables(self) -> list[Table]:
        """Return what the loop did, and what it recognised."""
        latencies = self.figures.latencies
        p50, p95, p99 = (1000 * latencies.percentile(percent) for percent in (50, 95, 99))
        growth = "-" if self.growth is None else f"{self.growth:.1f}"
        counts = ", ".join(f"{name} {count}" for name, count in sorted(self.figures.counts.items()))
        shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in self.limits.items())
        did = Table(
            title=self.title,
            header=(
                "",
                "minutes",
                "frames",
                "setpoints",
                "longest gap [ms]",
                "p50 [ms]",
                "p95 [ms]",
                "p99 [ms]",
                "growth [MB]",
            ),
            rows=(
                (
                    "loop",
                    f"{self.seconds / 60:.1f}",
                    str(self.figures.lines),
                    str(self.figures.setpoints),
                    f"{1000 * self.figures.longest_gap:.0f}",
                    f"{p50:.1f}",
                    f"{p95:.1f}",
                    f"{p99:.1f}",
                    growth,
                ),
            ),
            footnotes=(
                "p50, p95, p99: from a frame that came in to the first setpoint after it was watched. longest gap: "
                "between setpoints. growth: of the process's memory after the first stream.",
                f"Counted: {counts}.",
                f"Most that setpoints used of the vehicle's limits: {shares}.",
            ),
        )
        rows = [
            self._row(name, kind)
            for name, kind in (("none lost", self.lossless), ("some lost", ~self.lossless))
            if kind.any()
        ]
        recognised = Table(
            title="against the benchmark's record of the same streams",
            header=("frames", "streams", "equal", "same answer %", "apart at most", "right %", "right there %"),
            rows=tuple(rows),
            footnotes=(
                f"equal: streams whose probabilities are nowhere more than {EQUAL:g} apart. The benchmark loses none.",
            ),
        )
        return [did, recognised]

    def _row(self, name: str, kind: BoolArray) -> tuple[str, ...]:
        apart = self.apart[kind]
        return (
            name,
            str(kind.sum()),
            str((apart <= EQUAL).sum()),
            f"{100 * self.same[kind].mean():.2f}",
            f"{apart.max():.2g}",
            f"{100 * self.right[kind].mean():.1f}",
            f"{100 * self.right_there[kind].mean():.1f}",
        )


def frame_message(sensed: Sensed, viewpoint: FloatArray, time: float) -> str:
    """Return the line that a pose estimator would write of one frame.

    Args:
        sensed: joints (1, P, J, 2) and confidence (1, P, J).
        viewpoint: (1, 3), where the camera was.
        time: when [s].
    """
    joints = np.concatenate([sensed.joints_2d[0], sensed.confidence[0, ..., None]], axis=-1).tolist()
    east, north, up = cartesian(viewpoint[0]).tolist()
    return written(
        Frame(
            time=time,
            people=tuple(
                SeenPerson(keypoints=tuple((x, y, seen) for x, y, seen in person), id=number)
                for number, person in enumerate(joints)
            ),
            camera=CameraPose(
                position=(east, north, up),
                yaw=float(viewpoint[0, AZIMUTH] + np.pi),
                pitch=float(viewpoint[0, POLAR] - np.pi / 2),
            ),
            joints="own",
        )
    )


class Player:
    """Plays test streams in real time, around a camera that flies as the setpoints say.

    Between two streams nothing is heard until the vehicle hovers. In every second stream frames are lost, and as many
    come late, after newer ones.

    Args:
        setting: the streams, and who sees them.
        episodes: the episodes of the test part.
        watcher: who watches; its setpoints carry the camera.
        count: number of streams.
        loss: share of frames that are lost in every second stream.
    """

    def __init__(self, setting: Setting, episodes: Episodes, watcher: Watcher, count: int, loss: float) -> None:
        """Take all memory and draw all noise now: later, that would take the time of the loop."""
        self._setting, self._watcher, self._loss = setting, watcher, loss
        self.fps, self.length = setting.recordings.fps, episodes.scenarios.length
        self.chosen = np.arange(count) % len(episodes)
        self._played = {int(episode): episodes.pick([int(episode)]) for episode in np.unique(self.chosen)}
        self.lossless = (np.arange(count) % 2 == 0) | (loss == 0)
        self.starts = np.zeros((count, 3))
        self.begins = np.full(count, np.inf)  # [s], times of first frames
        self.believed = np.full((count, self.length, len(watcher.class_names)), -1.0)
        self.memory: list[float] = []  # [MB] after each stream

    def hear(self, answer: Answer) -> None:
        """Keep what was believed after a frame."""
        stream = int(np.searchsorted(self.begins, answer.time + 0.5 / self.fps)) - 1
        frame = round((answer.time - self.begins[stream]) * self.fps)
        if answer.joints is not None and 0 <= frame < self.length:
            self.believed[stream, frame] = list(answer.belief.values())

    def lines(self) -> Iterator[str]:
        """Yield the frames as they are taken."""
        rng = np.random.default_rng(0)
        for stream, episode in enumerate(self.chosen):
            if stream:
                self._wait_for_rest()
                self.memory.append(peak_megabytes())
            batch = self._played[int(episode)]
            setpoints = self._watcher.setpoints
            viewpoint = setpoints.state().viewpoint if setpoints.begun else batch.starts
            self.starts[stream] = viewpoint[0]
            begin = self.begins[stream] = time.monotonic()
            held_back: list[tuple[float, str]] = []
            for frame in range(self.length):
                at = begin + frame / self.fps
                time.sleep(max(at - time.monotonic(), 0.0))
                viewpoint = setpoints.state().viewpoint if setpoints.begun else batch.starts
                noise = batch.noise.frame(frame)
                sensed = sense(self._setting.runner.sensor, batch.positions[:, frame], viewpoint, noise)
                line = frame_message(sensed, viewpoint, at)
                draw = 1.0 if self.lossless[stream] or not frame else rng.random()
                if draw < self._loss:
                    continue
                if draw < 2 * self._loss:
                    held_back.append((at + rng.uniform(*LATE), line))
                    continue
                yield line
                yield from (old for due, old in held_back if due <= at)
                held_back = [(due, old) for due, old in held_back if due > at]
        self.memory.append(peak_megabytes())

    def _wait_for_rest(self) -> None:
        """Say nothing until the vehicle hovers, as it does when it hears nothing."""
        while not (self._watcher.setpoints.braking and self._watcher.setpoints.resting):
            time.sleep(PACE)

    def batch(self, stream: int) -> Batch:
        """Return a stream as the benchmark shows it, from where the camera was."""
        return replace(self._played[int(self.chosen[stream])], starts=self.starts[stream : stream + 1])


def rehearse(
    conditions: Conditions,
    *,
    planner: str | Planner,
    belief: str | Path | None,
    sure: float,
    minutes: float,
    loss: float,
    outputs: Callable[[Watcher], Sequence[Callable[[Said], None]]],
    note: Callable[[str], None],
    world: str | Path | World | None = None,
) -> Rehearsal:
    """Play test streams through the loop in real time, and compare it with the benchmark.

    Args:
        conditions: streams, weights, sensor, views, vehicle and seed; of the shipped weights also the world.
        planner: as in `Watcher`.
        belief: as in `Watcher`.
        sure: as in `Watcher`.
        minutes: how long to play; whole streams of 30 s, at least one.
        loss: share of frames that are lost, and that are late, in every second stream.
        outputs: returns what takes all that goes out.
        note: is told of progress.
        world: as in `Watcher`.

    Raises:
        EharError: something is missing or malformed, or does not fit; the data are no streams, or the world not open.
    """
    if not 0 < minutes < np.inf:
        raise UsageError(f"minutes: expected a number above 0, got {minutes}")
    if not conditions.in_streams:
        load_recordings_of(conditions)  # which tells of a file that is not there
        name = conditions.data.name if isinstance(conditions.data, MotionData) else conditions.data
        raise UsageError(f"{name}: expected streams, as `ehar data stitch` makes them, got trimmed sequences")
    if world is not None:
        conditions = replace(conditions, world=world)
    elif conditions.models is not None:
        conditions = replace(conditions, world=live_recogniser(conditions).spec.world)
    setting = load_setting(conditions)
    if not setting.world.is_open:
        raise UsageError(f"world {setting.world.name}: expected one in which nothing is in the way of a rehearsal")
    streams, recogniser, vehicle = setting.recordings, setting.runner.recogniser, setting.runner.track.vehicle
    if not 0 <= loss < 0.5:
        raise UsageError(f"loss: expected a share of frames from 0 to below 0.5, got {loss}")
    assert isinstance(streams, StreamData) and isinstance(recogniser, StreamingRecogniser) and vehicle is not None
    place = ModelPlace.of(setting)
    chosen, _ = resolve_planner(planner, place.load_gain_model, place.load_agent, place.load_fixed_place)
    watcher = Watcher(
        models=recogniser,
        vehicle=vehicle,
        planner=chosen,
        belief=belief,
        sure=sure,
        seed=conditions.seed,
        world=setting.world,
    )
    if watcher.note is not None:
        note(f"warning: {watcher.note}")
    scenarios = cut_scenarios(streams, part_of(streams, conditions.part), setting.conditions.frames, note)
    episodes = random_starts(scenarios, 1, conditions.seed, setting.world)
    count = max(round(60 * minutes * streams.fps / scenarios.length), 1)
    player = Player(setting, episodes, watcher, count, loss)
    shares = LimitShares(vehicle)
    note(f"{count} stream{'s' * (count != 1)} of {scenarios.length / streams.fps:.0f} s, in real time")
    figures = Loop(watcher, (lambda said: shares.take(said.setpoint), *outputs(watcher)), hears=player.hear).run(
        player.lines()
    )
    note("the same streams in the benchmark")
    compared = [_compare(player, stream, setting, watcher) for stream in range(count)]
    same, apart, right, right_there = (np.array(held) for held in zip(*compared, strict=True))
    return Rehearsal(
        title=f"{streams.name}: {watcher.planner.name} on {vehicle.name}, sensor {setting.conditions.sensor}",
        figures=figures,
        seconds=count * scenarios.length / streams.fps,
        growth=player.memory[-1] - player.memory[0] if count > 1 else None,
        limits=shares.greatest,
        lossless=player.lossless,
        same=same,
        apart=apart,
        right=right,
        right_there=right_there,
    )


def _compare(player: Player, stream: int, setting: Setting, watcher: Watcher) -> tuple[float, float, float, float]:
    """Return the share of frames with the same answer, the greatest difference, and what is right here and there.

    A frame that was lost has the answer of the frame before.
    """
    batch = player.batch(stream)
    record = setting.runner.roll(watcher.planner, batch, np.random.default_rng(setting.conditions.seed))
    there = read_streams(watcher.belief_model, record.log_probs, record.viewpoints, fps=player.fps)[0]
    here = player.believed[stream]
    heard = here[:, 0] >= 0
    last = np.maximum.accumulate(np.where(heard, np.arange(len(here)), 0))
    answers, label = here[last].argmax(axis=1), batch.frame_labels[0]
    return (
        float((answers == there.argmax(axis=1)).mean()),
        float(np.abs(here - there)[heard].max()),
        float((answers == label).mean()),
        float((there.argmax(axis=1) == label).mean()),
    )


def peak_megabytes() -> float:
    """Return the most memory that this process had [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)  # bytes there, kilobytes elsewhere
