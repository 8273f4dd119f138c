"""Episodes of a run, run once more: do cameras go where they went, and see what they saw?

What is drawn for an episode depends on the chunk that it runs in: whole chunks are run, as in the benchmark, and all
of their episodes are compared. On the machine and with the versions of the run all recorded digits are the same.
Elsewhere sums may be taken in another order: without AVX and FMA, probabilities differ by up to 1e-6. What differs by
less than the tolerances below is noise; what differs by more is a difference, even where a choice between two moves
that are nearly as good, taken the other way, has sent a camera elsewhere. Versions that are not the run's are
therefore listed beside the result.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import ModelError, UsageError
from ehar.planner import Planner
from ehar.rollout import Record
from ehar.viewpoint import AZIMUTH, wrap_difference
from eval.episodes import CHUNK, Episodes
from eval.flight_records import KEYS, FlightRecords
from eval.jobs import World, roll_chunk
from eval.planner_choice import ModelPlace
from eval.progress import Reporter
from eval.records import EpisodeRecords
from eval.results import EPISODES, RunConfig, planner_config
from eval.verification import FAILED, OK, UNCHECKED, Check
from eval.verify_records import place
from planners.registry import make_planner

if TYPE_CHECKING:
    from eval.run import Setting

VIEWPOINT = 1e-4  # [m], [rad]
PROBABILITY = 1e-4
FLIGHT = 1e-2  # of a peak or an effort, which sum up what VIEWPOINT allows


def check_replay(
    config: RunConfig,
    records: Mapping[str, EpisodeRecords],
    episodes: Episodes,
    setting: "Setting",
    models: ModelPlace,
    *,
    count: int,
    seed: int,
    reporter: Reporter,
) -> list[Check]:
    """Run episodes once more, and compare them with what is recorded, up to the first difference.

    Args:
        config: of the run.
        records: of the run.
        episodes: of the run.
        setting: of the run.
        models: where gain models and agents of the run lie.
        count: of episodes that are drawn; those that run beside them are compared too.
        seed: of the draw.
        reporter: hears of progress.

    Raises:
        EpisodeError: a planner broke its contract.
        ModelError: the belief that was scored is not there.
    """
    belief = models.load_gain_model().belief if config.readout == "belief" else None
    world = World(episodes, setting.recogniser, setting.sensor, config.vehicle, belief)
    planners, left = make_again(config, models)
    checks = [Check("replay", UNCHECKED, f"{name}: {reason}") for name, reason in left.items()]
    if not planners:
        return checks
    jobs = draw_jobs(list(planners), len(episodes), count, np.random.default_rng(seed))
    compared = 0
    reporter.begin(len(jobs))
    try:
        for name, chunk in jobs:
            record, flight = roll_chunk(world, planners[name], chunk)
            difference = first_difference(name, records[name], chunk * CHUNK, record, flight)
            if difference is not None:
                return [Check("replay", FAILED, difference), *checks]
            compared += len(record.viewpoints)
            reporter.advance(name)
    finally:
        reporter.end()
    ran = len({name for name, _ in jobs})
    return [
        Check("replay", OK, f"{compared} episodes of {ran} planners, in {len(jobs)} chunks with {count} drawn"),
        *checks,
    ]


def make_again(config: RunConfig, models: ModelPlace) -> tuple[dict[str, Planner], dict[str, str]]:
    """Return the run's planners that their names suffice to make, and why the others cannot be replayed.

    A planner that was given as an object, or came from a file, has a name that says nothing, or another class.
    """
    made, left = {}, {}
    for held in config.planners:
        try:
            planner = make_planner(held.name, models.load_gain_model, models.load_agent)
        except UsageError:
            left[held.name] = "it cannot be made from its name"
            continue
        except ModelError as error:
            left[held.name] = str(error)
            continue
        made[held.name] = planner
        for field, ran in asdict(held).items():
            again = getattr(planner_config(planner), field)
            if again != ran and held.name in made:
                left[held.name] = f"another was made from its name: {field} {again}, and {ran} ran"
                del made[held.name]
    return made, left


def draw_jobs(names: Sequence[str], episodes: int, count: int, rng: np.random.Generator) -> list[tuple[str, int]]:
    """Return the planners and chunks in which `count` episodes lie: even over planners, at random over the run.

    Args:
        names: of planners, at least one.
        episodes: of each of them.
        count: of episodes to draw; more than there are means all.
        rng: draws.
    """
    drawn: dict[str, IntArray] = {}
    order = rng.permutation(len(names))
    for rank, index in enumerate(order):
        share = count // len(names) + (rank < count % len(names))
        drawn[names[index]] = np.unique(rng.permutation(episodes)[:share] // CHUNK)
    return [(name, int(chunk)) for name in names for chunk in drawn[name]]


def first_difference(
    name: str, recorded: EpisodeRecords, begin: int, record: Record, flight: FlightRecords | None
) -> str | None:
    """Return where a replay first differs from the records beyond tolerance, with what is recorded as got.

    Args:
        name: the planner's.
        recorded: of all its episodes.
        begin: the first episode that was replayed.
        record: of the replayed ones, B.
        flight: what they demanded of a vehicle.
    """
    rows = np.arange(begin, begin + len(record.viewpoints))
    found = []
    for rank, frames in enumerate(_compared(recorded, rows, record)):
        if frames.off.any():
            at, frame = (int(index) for index in np.argwhere(frames.off)[0])
            found.append((at, frame, rank, frames))
    if found:
        at, frame, _, frames = min(found, key=lambda one: one[:3])
        where = place(name, recorded, int(rows[at]), frame)
        got, expected = frames.got[at, frame].tolist(), frames.expected[at, frame].tolist()
        return f"{where}: {frames.field}: got {_text(got)}, expected {_text(expected)} as replayed"
    if (flight is None) != (recorded.flight is None):
        return f"{EPISODES}: {name}: got {'a' if flight is None else 'no'} flight, expected the other as replayed"
    for key in KEYS if flight is not None else ():
        got, expected = getattr(recorded.flight, key)[rows], getattr(flight, key)
        # A frame is at a limit or is not: one of them may lie on the edge.
        slack = 1 / recorded.predicted.shape[1] if key == "limit_share" else FLIGHT * np.maximum(np.abs(expected), 1)
        off = np.abs(got - expected) > slack
        if off.any():
            at = int(off.argmax())
            where = place(name, recorded, int(rows[at]))
            return f"{where}: {key}: got {_text(got[at])}, expected {_text(expected[at])} as replayed"
    return None


class _Frames(NamedTuple):
    field: str
    got: FloatArray | IntArray
    expected: FloatArray | IntArray
    off: BoolArray  # (B, L)


def _compared(recorded: EpisodeRecords, rows: IntArray, record: Record) -> Iterator[_Frames]:
    """Yield what is compared of each frame, causes before effects."""
    moved = record.viewpoints - recorded.viewpoint[rows]
    moved[..., AZIMUTH] = wrap_difference(moved[..., AZIMUTH])
    elsewhere = np.abs(moved).max(axis=-1) > VIEWPOINT
    yield _Frames("viewpoint", recorded.viewpoint[rows], record.viewpoints, elsewhere)
    probabilities = np.exp(record.log_probs.astype(np.float64))
    top = probabilities.max(axis=-1)
    label = np.broadcast_to(recorded.label[rows, None], top.shape)
    predicted, true = recorded.predicted[rows], np.take_along_axis(probabilities, label[..., None], axis=-1)[..., 0]
    of_predicted = np.take_along_axis(probabilities, predicted[..., None], axis=-1)[..., 0]
    # Of two classes that are nearly as probable either may be the first.
    yield _Frames("predicted", predicted, probabilities.argmax(axis=-1), of_predicted < top - PROBABILITY)
    for field, expected in (("true_probability", true), ("top_probability", top)):
        got = getattr(recorded, field)[rows]
        yield _Frames(field, got, expected, np.abs(got - expected) > PROBABILITY)


def _text(value: float | list[float]) -> str:
    """Return numbers with as many digits as are compared."""
    return f"[{', '.join(map(_text, value))}]" if isinstance(value, list) else f"{value:.6g}"
