"""Runs episodes of a run again: do cameras see the same from the recorded viewpoints, and do planners move the same?

The random numbers of a planner depend on its chunk. So whole chunks run, as in the benchmark, and all of their episodes
are compared. What is recognised depends on no other episode, so that is asked in groups of another order. On the same
machine, with the same versions, all recorded digits are the same. On another machine sums may have another order:
without AVX and FMA, probabilities differ by up to 2e-4, and a planner may choose the other one of two moves that are
nearly as good. So cameras are kept on the recorded way. The recognition has to be the same in every frame, within a
tolerance, and a planner's moves in most frames. A flight cannot be brought back to its recorded velocity, because
records do not hold it. So a flying planner that goes elsewhere in many frames is not checked.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.batch import Batch
from ehar.errors import DataError, EharError, UsageError
from ehar.obstacles.surroundings import Surroundings
from ehar.planner import Planner
from ehar.plugins.loading import source_sha256
from ehar.rollout import Record
from ehar.track import IDEAL
from eval.records.config import CONFIG, PlannerConfig, RunConfig, planner_config
from eval.records.contacts import CONTACTS, contacts_of
from eval.records.episodes import DIGITS, TRACKING, EpisodeRecords
from eval.records.flights import KEYS, FlightRecords, flights_of, held_flight, tracking_of
from eval.records.run_files import EPISODES
from eval.running.choice import ModelPlace
from eval.running.episodes import CHUNK, Episodes
from eval.running.jobs import Workload
from eval.running.progress import Reporter
from eval.verification.checks import FAILED, OK, UNCHECKED, Check
from eval.verification.followed_way import FollowedWay
from eval.verification.records import place
from eval.verification.seen import seen_difference
from planners.heuristic import NoAct
from planners.own_planner import Origin, load_own_class, make_own_planner, own_spec
from planners.registry import is_ours, make_planner
from recognition.setting import Setting

FLIGHT = 1e-2  # share of what a flight demands and of tracking errors; at least 1e-2 in their units
EDGE = 1e-4  # [m]; a camera that is nearer to the edge of too near may be counted or not, as viewpoints are rounded
MIXED = CHUNK - 8  # episodes that are looked at together
MOVES = 0.95  # share of frames in which a planner has to move as recorded


def check_replay(
    config: RunConfig,
    records: Mapping[str, EpisodeRecords],
    episodes: Episodes,
    setting: Setting,
    models: ModelPlace,
    *,
    count: int,
    seed: int,
    reporter: Reporter,
) -> list[Check]:
    """Run episodes again, and compare them with the records.

    Args:
        config: configuration of the run.
        records: records of the run.
        episodes: episodes of the run.
        setting: setting of the run.
        models: place of the run's gain models and agents.
        count: number of episodes to draw; the other episodes of their chunks are compared too.
        seed: seed of the draw.
        reporter: receives progress.

    Raises:
        EpisodeError: a planner broke its contract.
        ModelError: the run scored a belief, and its gain model is missing.
    """
    belief = models.load_gain_model().belief if config.readout == "belief" else None
    workload = Workload(setting.runner, episodes, belief)
    rng = np.random.default_rng(seed)
    jobs = draw_jobs(list(records), len(episodes), count, rng)
    groups = mixed(jobs, len(episodes), rng)
    nudges = {name: np.zeros(records[name].viewpoint.shape) for name, _ in jobs}
    sensor = setting.runner.sensor
    reporter.begin(len(groups) + len(jobs))
    try:
        for name, rows in groups:
            held, batch = records[name], workload.followed.pick(rows.tolist())
            # A planner that stays sees the same on the recorded way. The planner of the run is not asked, nor is its
            # file loaded before: what it did to the recogniser would be seen again.
            look = partial(_stay_on, held.viewpoint[rows], workload, batch)
            record = look(nudges[name][rows])
            difference, nudges[name][rows] = seen_difference(name, held, rows, record, batch, sensor, look)
            difference = difference or contacts_difference(name, held, rows, batch.surroundings)
            if difference is not None:
                return [Check("seen again", FAILED, difference)]
            reporter.advance(name)
        try:
            planners, left = make_again(config, models)
        except DataError as error:
            return [Check("moves again", FAILED, str(error))]
        moves = {name: Moves() for name, _ in jobs if name in planners}
        for name, chunk in jobs:
            if name in planners:
                body, rows = setting.runner.new_motion(), _rows(chunk, len(records[name]))
                motion = FollowedWay(body, records[name].viewpoint[rows], nudges[name][rows])
                workload.roll(planners[name], workload.followed.batch(chunk), chunk, motion)
                flight = flights_of(body)
                if flight is not None:
                    told = name, records[name], rows
                    difference = flight_difference(*told, flight, motion.elsewhere) or tracking_difference(
                        *told, tracking_of(body), motion.elsewhere
                    )
                    if difference is not None:
                        return [Check("seen again", FAILED, difference)]
                moves[name] = moves[name].after(motion.elsewhere, rows)
            reporter.advance(name)
    finally:
        reporter.end()
    compared = sum(len(rows) for _, rows in groups)
    what = f"{compared} episodes of {len({name for name, _ in jobs})} planners, {count} drawn and those of their chunks"
    on_edge = sum(int(moved.any(axis=(1, 2)).sum()) for moved in nudges.values())
    if on_edge:
        what += f"; in {on_edge} of them a joint is on an edge, and was seen from the side that fits"
    led = setting.runner.track.named == IDEAL
    return [Check("seen again", OK, what), *check_moves(records, moves, left, led=led)]


def _rows(chunk: int, episodes: int) -> IntArray:
    """Return the rows of a chunk in the records."""
    return np.arange(chunk * CHUNK, min((chunk + 1) * CHUNK, episodes))


def mixed(jobs: Sequence[tuple[str, int]], episodes: int, rng: np.random.Generator) -> list[tuple[str, IntArray]]:
    """Return the episodes of all jobs of a planner in groups of another order and size, which were no chunk.

    A chunk holds few classes. So a recogniser that looks at other rows than its own could read the class there, and
    would do so again in the same chunk.

    Args:
        jobs: planners and chunks.
        episodes: number of episodes of each planner.
        rng: generator of the order.
    """
    groups = []
    for name in dict.fromkeys(name for name, _ in jobs):
        rows = rng.permutation(np.concatenate([_rows(chunk, episodes) for of, chunk in jobs if of == name]))
        groups += [(name, group) for group in np.array_split(rows, max(min(2, len(rows)), -(-len(rows) // MIXED)))]
    return groups


def _stay_on(way: FloatArray, workload: Workload, batch: Batch, nudges: FloatArray) -> Record:
    """Run episodes on their recorded way (B, L, 3), moved by nudges, with a planner that stays."""
    return workload.roll(NoAct(), batch, 0, FollowedWay(workload.runner.new_motion(), way, nudges))


class Moves(NamedTuple):
    """The number of compared frames of a planner, how many lead elsewhere, and the first of these, (episode, frame)."""

    frames: int = 0
    elsewhere: int = 0
    first: tuple[int, int] | None = None

    def after(self, elsewhere: BoolArray, rows: IntArray) -> "Moves":
        """Add a chunk, (B, L); its first frame does not count, because no planner chose it."""
        first = self.first
        if first is None and elsewhere.any():
            episode, frame = np.argwhere(elsewhere)[0]
            first = (int(rows[episode]), int(frame))
        chosen = elsewhere[:, 1:]
        return Moves(self.frames + chosen.size, self.elsewhere + int(chosen.sum()), first)


def check_moves(
    records: Mapping[str, EpisodeRecords], moves: Mapping[str, Moves], left: Mapping[str, str], *, led: bool = True
) -> list[Check]:
    """Return the checks of moves: one for all planners that move as recorded, and one for each other planner.

    Args:
        records: records of the run.
        moves: compared moves by planner.
        left: the planners that could not act again, and why.
        led: whether bodies that left the recorded way were brought back to it.
    """
    checks, kept = [], []
    for name, moved in moves.items():
        counted = f"goes elsewhere in {moved.elsewhere} of {moved.frames} frames"
        if moved.first is None or moved.elsewhere <= (1 - MOVES) * moved.frames:
            kept.append(moved)
        elif records[name].flight is None and led:
            where = place(name, records[name], *moved.first)
            what = f"{where}: {counted}, this is the first; expected the way recorded in {MOVES:.0%} of them"
            checks.append(Check("moves again", FAILED, what))
        else:
            # The planner may have changed, or one near tie may have sent it another way.
            what = f"{name}: {counted}; a flight that left its way cannot be brought back to it"
            checks.append(Check("moves again", UNCHECKED, what))
    if kept:
        frames, elsewhere = sum(moved.frames for moved in kept), sum(moved.elsewhere for moved in kept)
        what = f"{frames - elsewhere} of {frames} frames of {len(kept)} planners"
        checks.insert(0, Check("moves again", OK, what))
    return checks + [Check("moves again", UNCHECKED, f"{name}: {reason}") for name, reason in left.items()]


def make_again(config: RunConfig, models: ModelPlace) -> tuple[dict[str, Planner], dict[str, str]]:
    """Return the planners that can be made again from the configuration, and why each other planner cannot.

    A planner that was given as an object cannot: only its class is recorded. A planner from a file, a module or an
    entry point is made with its arguments if its file has not changed.

    Raises:
        DataError: one is told the truth, and the configuration says otherwise, or the other way round.
    """
    made: dict[str, Planner] = {}
    left: dict[str, str] = {}
    for held in config.planners:
        try:
            planner, origin = _make_one_again(held, models)
        except EharError as error:
            left[held.name] = str(error)
        else:
            if planner.privileged != held.privileged:
                got = f"got {held.privileged}, expected {planner.privileged}, as the planner that is made again"
                raise DataError(f"{CONFIG}: {held.name}: privileged: {got}")
            again, ran = (asdict(config) for config in (planner_config(planner, origin), held))
            if origin is None:  # a class of ehar may have moved to another module since
                for told in (again, ran):
                    told["implementation"] = told["implementation"].rpartition(".")[2]
            other = [f"{field} {again[field]}, ran: {value}" for field, value in ran.items() if again[field] != value]
            if other:
                left[held.name] = f"not replayable, as another is made: {'; '.join(other)}"
            else:
                made[held.name] = planner
    return made, left


def _make_one_again(held: PlannerConfig, models: ModelPlace) -> tuple[Planner, Origin | None]:
    """Return a planner and its origin; the origin is None for a planner of ehar.

    Raises:
        UsageError: the planner cannot be made, or its file has changed since the run.
        ModelError: its weights are not here.
    """
    spec = own_spec(held.implementation)
    if spec is None:
        if not is_ours(held.name):
            raise UsageError("not replayable, as it cannot be made from its name")
        return make_planner(held.name, models.load_gain_model, models.load_agent, models.load_fixed_place), None
    try:
        found = source_sha256(load_own_class(spec))
        if found != held.source_sha256:
            changed = "its file, or one beside it that it imports, has changed"
            raise UsageError(f"{changed}: got sha256 {found}, ran: {held.source_sha256}")
        return make_own_planner(replace(spec, arguments=held.arguments), models.load_gain_model)
    except UsageError as error:
        raise UsageError(f"not replayable: {error}") from error


def draw_jobs(names: Sequence[str], episodes: int, count: int, rng: np.random.Generator) -> list[tuple[str, int]]:
    """Draw `count` episodes, evenly over planners and at random over the run; return their planners and chunks.

    Args:
        names: names of planners, at least one.
        episodes: number of episodes of each planner.
        count: number of episodes to draw; a number above all of them means all.
        rng: generator of the draw.
    """
    drawn: dict[str, IntArray] = {}
    for rank, index in enumerate(rng.permutation(len(names))):
        share = count // len(names) + (rank < count % len(names))
        drawn[names[index]] = np.unique(rng.permutation(episodes)[:share] // CHUNK)
    return [(name, int(chunk)) for name in names for chunk in drawn[name]]


def flight_difference(
    name: str, recorded: EpisodeRecords, rows: IntArray, flight: FlightRecords, elsewhere: BoolArray
) -> str | None:
    """Return the first flight whose demands on the vehicle differ from the records; None if all are the same.

    Args:
        name: name of the planner.
        recorded: records of all its episodes.
        rows: (B,) indices of the episodes that flew again.
        flight: demands of these flights.
        elsewhere: (B, L) frames off the recorded way; a flight with such a frame is not compared.
    """
    if recorded.flight is None:
        return f"{EPISODES}: {name}: got no {', '.join(KEYS)}, expected those of a flight"
    now = held_flight(flight)
    for key, values in held_flight(recorded.flight).items():
        if key not in now:
            return f"{EPISODES}: {name}: got {key}, expected none for this vehicle"
        got, expected = values[rows], now[key]
        # A frame counts as at a limit or not: one frame may lie on the edge.
        slack = 1 / recorded.predicted.shape[1] if key == "limit_share" else FLIGHT * np.maximum(expected, 1)
        off = ~(np.abs(got - expected) <= slack + 10**-DIGITS) & ~elsewhere.any(axis=1)
        if off.any():
            at = int(off.argmax())
            return f"{place(name, recorded, int(rows[at]))}: {key}: got {got[at]:.6g}, expected {expected[at]:.6g}"
    return None


def tracking_difference(
    name: str, recorded: EpisodeRecords, rows: IntArray, tracking: FloatArray | None, elsewhere: BoolArray
) -> str | None:
    """Return the first frame in which a flight was not as far from its planner's path as recorded; None if all were.

    Args:
        name: name of the planner.
        recorded: records of all its episodes; those from before it was recorded are not compared.
        rows: (B,) indices of the episodes that flew again.
        tracking: (B, L) [m], how far they were from the paths; None without paths.
        elsewhere: (B, L) frames off the recorded way; a flight with such a frame is not compared.
    """
    there = ~elsewhere.any(axis=1, keepdims=True)
    if recorded.tracking_error is None or not there.any():
        return None
    if tracking is None:
        return f"{EPISODES}: {name}: got a {TRACKING}, expected none of a planner without paths"
    got = recorded.tracking_error[rows]
    off = ~(np.abs(got - tracking) <= FLIGHT * np.maximum(tracking, 1) + 10**-DIGITS) & there
    if not off.any():
        return None
    at, frame = (int(index) for index in np.argwhere(off)[0])
    where = place(name, recorded, int(rows[at]), frame)
    return f"{where}: {TRACKING}: got {got[at, frame]:.6g}, expected {tracking[at, frame]:.6g}"


def contacts_difference(
    name: str, recorded: EpisodeRecords, rows: IntArray, surroundings: Surroundings | None
) -> str | None:
    """Return the first episode in which the camera was not as often too near to obstacles as recorded; None if none.

    Args:
        name: name of the planner.
        recorded: records of all its episodes.
        rows: (B,) indices of the compared episodes.
        surroundings: what stands around them.
    """
    way = recorded.viewpoint[rows]
    fewest, most = (contacts_of(surroundings, way, farther=farther) for farther in (EDGE, -EDGE))
    if recorded.contacts is None or fewest is None or most is None:
        return None  # who has them is a check of the records
    for key in CONTACTS:
        got, least, greatest = (getattr(of, key) for of in (recorded.contacts, fewest, most))
        got = got[rows]
        off = (got < least) | (got > greatest)
        if off.any():
            at = int(off.argmax())
            upto = f" to {greatest[at]}" if greatest[at] > least[at] else ""
            return f"{place(name, recorded, int(rows[at]))}: {key}: got {got[at]}, expected {least[at]}{upto}"
    return None
