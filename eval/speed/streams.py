"""Streams: how fast they are watched and planned in, what a late frame costs, and how soon an activity is let go."""

import time
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.batch import Batch, noise_of
from ehar.conditions import Conditions
from ehar.data.stitching.joins import DURATIONS, join, placed
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.synthetic.sets import TRAINING_CASTS, dance
from ehar.planner import Context, Observation, Planner
from ehar.recogniser import Recogniser
from ehar.runner import Runner
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed
from ehar.world import CROWD, PAPER, ROOM, World
from eval.scores.streams.alarms import delays
from eval.speed.effort import WORKERS, Effort
from eval.speed.planning import VEHICLE
from eval.speed.recognition import untrained
from planners.heuristic import HRotate, NoAct
from planners.search.next_best_view import NextBestView
from planners.value.model import load_gain_model
from recognition.networks.layers import FADING_REFRESH
from recognition.setting import load_setting

STREAMS = "solo-stream"
SENSOR = "estimator"
EARLY_FRAME = 60  # that `Effort.late_frame` is compared with
AFTER = (30, 300)  # frames of one activity, behind which another comes
SHOWN = 200  # frames of the other activity, as in most of the set's
AHEAD = (3, 7)  # classes, from the first activity to the second
MORE = 8  # times the usual repeats: one frame takes a millisecond, and other processes ten at a time
FIRST_PLANS = 12  # frames of flights that warm up: the problem is built with the first plan
PLANNED = 120  # frames of each flight in which plans are timed
WINDOW = 240  # frames that an untrained recogniser is meant for


def time_streams(data: StreamData, effort: Effort) -> float:
    """Return how many times real time this process watches its share of the streams: seconds of them in a second.

    Everything that a benchmark does is in it: the planner (h-rotate), the ideal track, sensing, and recognising.
    """
    count = max(1, effort.streams // WORKERS)
    runner = Runner(data, _untrained(data), make_sensor(SENSOR, data))
    for frames in (8, effort.stream_frames):  # the first warms up
        batch = _batch(StreamScenarios(data, frames, np.arange(count), np.zeros(count, dtype=np.int64)))
        begin = time.perf_counter()
        runner.roll(HRotate(), batch, np.random.default_rng(0))
        seconds = time.perf_counter() - begin
    return count * frames / data.fps / seconds


def time_flown_streams(effort: Effort, world: World) -> float:
    """Return as `time_streams` does, with nbv flown by `VEHICLE` in a world of ehar, and the weights that ship.

    Following people is not in it: that is done once for all planners of a process.

    Raises:
        ModelError: no weights ship.
    """
    count = max(1, effort.streams // WORKERS)
    setting = load_setting(Conditions(data=STREAMS, sensor=SENSOR, track=VEHICLE.name, world=world.name))
    told = setting.recordings
    assert isinstance(told, StreamData)
    planner = NextBestView(model=load_gain_model(setting.conditions, told, setting.recogniser_sha256))
    for frames in (FIRST_PLANS, effort.stream_frames):
        scenarios = StreamScenarios(told, frames, np.arange(count), np.zeros(count, dtype=np.int64))
        rng = np.random.default_rng(0)
        batch = setting.runner.batch(scenarios, np.arange(count), setting.world.sample_starts(rng, count), rng)
        begin = time.perf_counter()
        setting.runner.roll(planner, batch, rng)
        seconds = time.perf_counter() - begin
        if effort.compile:
            planner.compile()
    return count * frames / told.fps / seconds


def time_plans(effort: Effort) -> dict[str, float]:
    """Return how long nbv takes in a frame in which it plans, in flight with the weights that ship [ms].

    Everything is in it: the belief and where people are, the free cells, the ways of the search, and the control
    problem. One stream at a time, as live.

    Raises:
        ModelError: no weights ship.
    """
    figures: dict[str, float] = {}
    for name, world in (("nbv", PAPER), ("nbv_room", ROOM), ("nbv_crowd", CROWD)):
        setting = load_setting(Conditions(data=STREAMS, sensor=SENSOR, track=VEHICLE.name, world=world.name))
        told = setting.recordings
        assert isinstance(told, StreamData)
        planner = _Timed(NextBestView(model=load_gain_model(setting.conditions, told, setting.recogniser_sha256)))
        frames = min(effort.stream_frames, PLANNED)
        for stream in (0, *range(max(1, effort.streams // WORKERS))):  # the first warms up
            scenarios = StreamScenarios(told, frames, np.array([stream]), np.array([0]))
            rng = np.random.default_rng(stream)
            batch = setting.runner.batch(scenarios, np.array([0]), setting.world.sample_starts(rng, 1), rng)
            setting.runner.roll(planner, batch, rng)
            if not planner.timed:
                if effort.compile:
                    planner.planner.compile()
                planner.timed = True
                planner.seconds.clear()
        for kind, share in (("median", 50), ("p95", 95)):
            figures[f"{name}_plan_ms_{kind}"] = 1000 * float(np.percentile(planner.seconds, share))
    return figures


class _Timed(Planner):
    """Times nbv in the frames in which it plans."""

    name = "nbv"

    def __init__(self, planner: NextBestView) -> None:
        self.planner, self.timed, self.seconds = planner, False, list[float]()

    def reset(self, context: Context) -> None:
        self.planner.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        begin = time.perf_counter()
        path = self.planner.act(observation)
        if observation.frame % self.planner.replan == 0:
            self.seconds.append(time.perf_counter() - begin)
        return path


def late_over_early(data: StreamData, effort: Effort) -> float:
    """Return the time of a late frame of a stream divided by that of an early one, of one stream.

    The recogniser really takes all the frames in between. States stay valid, so the two are then timed in turn: the
    machine is as busy for one as for the other. Each is the mean, over the frames from one refreshed topology to the
    next, of medians over repeats.
    """
    recogniser, half = _untrained(data), FADING_REFRESH // 2
    batch = _batch(StreamScenarios(data, int(data.lengths[0]), np.array([0]), np.array([0])))
    sensed = sense(make_sensor(SENSOR, data), batch.positions, batch.starts[:, None], batch.noise)
    frames = [Sensed(*(array[:, frame] for array in sensed)) for frame in range(len(data.sequence(0)))]
    begins = (max(EARLY_FRAME - half, 0), effort.late_frame - half)
    state, states = recogniser.start(1), []
    for frame in range(effort.late_frame):
        states += [state] * (frame in begins)
        _, state = recogniser.step(state, frames[frame % len(frames)], batch.starts)
    seconds = np.empty((MORE * effort.repeats + 1, FADING_REFRESH, 2))
    for repeat in range(len(seconds)):
        running = list(states)
        for step in range(FADING_REFRESH):
            for which in range(2):
                begin = time.perf_counter()
                _, running[which] = recogniser.step(running[which], frames[step], batch.starts)
                seconds[repeat, step, which] = time.perf_counter() - begin
    early, late = np.median(seconds[1:], axis=0).mean(axis=0)  # the first warms up
    return float(late / early)


def letting_go(models: str | Path | None, effort: Effort) -> dict[str, float]:
    """Return how long after its onset an activity is recognised behind 30, and behind 300 frames of another [s].

    It is the delay of the stream table: until the answer is right and stays right, and all that is shown of the
    activity where it never does. Dancers of solo-stream's test part change from one figure to another, with a join in
    between as in stitched streams; the camera stays.

    Args:
        models: folder of a recogniser of solo-stream; None takes the one that ships.
        effort: the number of dancers.

    Raises:
        ModelError: there is no such recogniser.
    """
    setting = load_setting(Conditions(data=STREAMS, sensor=SENSOR, models=models))
    told = setting.recordings
    assert isinstance(told, StreamData)
    none, took = len(told.class_names), {}
    for frames in AFTER:
        data = changes(told, frames, effort.dancers)
        every = np.arange(len(data.lengths))
        batch = _batch(StreamScenarios(data, int(data.lengths[0]), every, np.zeros_like(every)))
        answers = setting.runner.roll(NoAct(), batch, np.random.default_rng(0)).log_probs.argmax(axis=-1)
        labels, answers = (np.where(classes == none, NO_ACTIVITY, classes) for classes in (batch.labels, answers))
        took[frames] = float(delays(labels, answers)[0].mean() / data.fps)
    return {
        **{f"recognised_s_after_{frames}_frames": seconds for frames, seconds in took.items()},
        "letting_go_later_s": took[AFTER[1]] - took[AFTER[0]],
    }


def changes(like: StreamData, frames: int, dancers: int) -> StreamData:
    """Return streams in which a dancer does one figure for so many frames, and then another for `SHOWN`.

    Args:
        like: solo-stream, for what all streams share.
        frames: frames of the first figure.
        dancers: people, of the test part; each changes to one figure and to another.
    """
    classes, longest = len(like.class_names), round(max(DURATIONS) * like.fps)
    length = frames + longest + SHOWN
    pieces: list[FloatArray] = []
    segments = []
    for dancer in range(dancers):
        for ahead in AHEAD:
            cast, first, second = TRAINING_CASTS + dancer, dancer % classes, (dancer + ahead) % classes
            before = dance(first, cast, frames)
            after = placed(dance(second, cast, longest + SHOWN), before[-1], like.skeleton)
            between = join(before, after, like.skeleton, like.fps)
            begin, onset = len(pieces) * length, len(pieces) * length + frames + len(between)
            segments += [(begin, begin + frames, first), (onset, onset + SHOWN, second)]
            pieces.append(np.concatenate([before, between, after])[:length])
    return StreamData(
        name="changes",
        positions=np.concatenate(pieces),
        offsets=np.arange(len(pieces) + 1) * length,
        class_names=like.class_names,
        sequence_names=tuple(f"change-{index}" for index in range(len(pieces))),
        fps=like.fps,
        skeleton=like.skeleton,
        is_test=np.ones(len(pieces), dtype=bool),
        subjects=np.repeat(np.arange(dancers), len(AHEAD))[:, None],
        segments=np.array(segments),
        missing=np.zeros(len(pieces) * length, dtype=bool),
        synthetic=True,
    )


def _untrained(data: StreamData) -> Recogniser:
    return untrained(data, "causal", "small", WINDOW)


def _batch(scenarios: StreamScenarios) -> Batch:
    """Return all the windows as episodes from random starts."""
    rng, rows = np.random.default_rng(0), np.arange(len(scenarios))
    return Batch.of(scenarios, rows, PAPER.sample_starts(rng, len(rows)), noise_of(scenarios, len(rows), rng))
