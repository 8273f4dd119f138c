"""The conformance kit of planners: it uses a few episodes and a trained recogniser."""

from collections.abc import Callable
from dataclasses import replace

import cloudpickle
import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.batch import Batch
from ehar.conditions import Conditions
from ehar.planner import Planner
from ehar.sensors.sensor import Sensed
from eval.conformance.checks import Conformance, ContractCheck, attempt, first_difference
from eval.conformance.runs import CheckedRun, PlannerWorld, joined, replay, run_planner
from eval.conformance.world import BATCH, ReplayedSensor, other_future, small_batch
from eval.running.choice import ModelPlace, choose_planners, listed
from recognition.setting import load_setting

FUTURE = "the future changes nothing"
TOLERANCE = 1e-4  # [m], [rad]: batches of another size may differ by rounding
FIRST, OTHERS = np.arange(BATCH), np.arange(BATCH, 2 * BATCH)
_RESET = "create in `reset` everything that `act` changes, and draw from `context.rng` there"
_RNG = "draw from `context.rng` alone: not from np.random, random or torch, and do not look at the time"
_ROWS = "compute every row from its own row: no mean, maximum or sort over axis 0"
_DRAWS = "; where you draw, draw for all rows and then choose"


def check_planner(planner: str | Planner, conditions: Conditions | None = None) -> Conformance:
    """Check that a planner keeps the contract of `ehar.planner`.

    Args:
        planner: an object, or a planner as `ehar benchmark` names it.
        conditions: conditions of the test episodes; None takes the defaults.

    Raises:
        EharError: the planner cannot be made, or data and weights cannot be loaded.
    """
    from recognition.torch_threads import one_torch_thread  # brings torch

    specs = listed(planner)
    setting = load_setting(conditions or Conditions())
    chosen = choose_planners(specs, ModelPlace.of(setting), readout="recogniser", note=lambda _: None).planners[0]
    world = PlannerWorld(setting.runner, small_batch(setting.recordings, setting.world))
    with one_torch_thread():
        return Conformance(f"planner {chosen.name}", tuple(_checks(chosen, world)))


def _checks(planner: Planner, world: PlannerWorld) -> list[ContractCheck]:
    """Return all checks; all others need the first one."""
    batch = world.batch.select(FIRST)
    try:
        copy_of = _copier(planner)
    except (Exception, SystemExit) as error:
        return [
            ContractCheck(
                "can be sent to a worker process",
                False,
                f"{type(error).__name__}: {error}",
                "an object that cloudpickle can pickle",
                "hold no open files, locks or generators; open them in `reset`",
            )
        ]
    finite = "finite target viewpoints of shape (B, 3): distance [m], azimuth [rad], polar angle [rad]"
    runs: list[CheckedRun] = []

    def runs_seven() -> None:
        runs.append(run_planner(copy_of(), world, batch))

    first = attempt(
        f"answers a batch of {BATCH} with finite targets ({BATCH}, 3)",
        runs_seven,
        expected=finite,
        mend="return one row an episode, as `observation.viewpoint` has them",
    )
    if not runs:
        return [first, ContractCheck("all else", None, "as it does not run")]
    run = runs[0]

    def shorter(rows: IntArray, *lengths: int | None) -> str | None:
        for frames in lengths:
            run_planner(copy_of(), world, world.batch.select(rows, frames))
        return None

    checks = [
        first,
        attempt(
            "answers a batch of 1 with finite targets (1, 3)",
            lambda: shorter(FIRST[:1], None),
            expected=finite,
            mend="do not squeeze arrays: a batch of one episode has a leading 1",
        ),
        attempt(
            "runs episodes of 1 and of 2 frames",
            lambda: shorter(FIRST, 1, 2),
            expected=finite,
            mend="an episode of L frames asks for L - 1 targets: none at all, or one",
        ),
        attempt(
            "leaves what it is shown as it is",
            lambda: _said_changed(run.changed),
            expected="observations that nobody changes",
            mend="work on a copy: `target = observation.viewpoint.copy()`",
        ),
    ]
    steady = attempt(
        "does the same with the same generator",
        lambda: first_difference(
            run.targets, run_planner(copy_of(), world, batch).targets, ("at first", "the second time"), tolerance=0
        ),
        expected="equal targets from two new copies of it",
        mend=_RNG,
    )
    checks.append(steady)
    if not steady.passed:
        reason = "as it does not do the same twice"
        names = ("forgets all in reset", "each row stands alone", "the hidden truth changes nothing", FUTURE)
        return [*checks, *(ContractCheck(name, None, reason) for name in names), _time(run)]
    checks += [
        attempt(
            "forgets all in reset",
            lambda: _second_time(copy_of(), world, batch, run.targets),
            expected="the same targets when one planner runs the same episodes again, and again",
            mend=_RESET,
        ),
        *_rows_alone(copy_of, world, run),
        _hidden_truth(copy_of(), world, batch, run),
        _other_future(copy_of(), world, batch, run),
        _time(run),
    ]
    return checks


def _copier(planner: Planner) -> Callable[[], Planner]:
    """Return a function that copies a planner as worker processes receive it."""
    payload = cloudpickle.dumps(planner)
    cloudpickle.loads(payload)
    return lambda: cloudpickle.loads(payload)


def _second_time(planner: Planner, world: PlannerWorld, batch: Batch, expected: FloatArray) -> str | None:
    run_planner(planner, world, world.batch.select(OTHERS))
    for after in ("after it ran other episodes", "after it ran the same episodes"):
        again = run_planner(planner, world, batch).targets
        difference = first_difference(expected, again, ("when new", after), tolerance=0)
        if difference is not None:
            return difference
    return None


def _rows_alone(copy_of: Callable[[], Planner], world: PlannerWorld, run: CheckedRun) -> list[ContractCheck]:
    """Check that the targets of a row depend on that row only.

    The planner sees the same observations again, so that only the planner can make a difference. A planner that draws
    from its generator draws other numbers in a batch of another size. So for it only every second row is replaced.
    """
    other_run = run_planner(copy_of(), world, world.batch.select(OTHERS))
    shown = [
        joined(one, other)
        for one, other in zip(run.recorder.observations, other_run.recorder.observations, strict=True)
    ]

    def targets(rows: IntArray) -> FloatArray:
        return replay(copy_of(), world, shown, world.batch, rows)

    def beside_others() -> str | None:
        whole = targets(FIRST)
        for kept in (FIRST % 2 == 0, FIRST % 2 == 1):
            mixed = targets(np.where(kept, FIRST, OTHERS))
            names = ("beside some episodes", "beside others")
            difference = first_difference(
                np.where(kept[:, None], whole, 0), np.where(kept[:, None], mixed, 0), names, tolerance=TOLERANCE
            )
            if difference is not None:
                return difference
        return None

    def alone() -> str | None:
        whole, rows = targets(FIRST), FIRST[::-1]
        names = (f"in a batch of {BATCH}", "in another order")
        difference = first_difference(whole, targets(rows)[:, np.argsort(rows)], names, tolerance=TOLERANCE)
        if difference is not None:
            return difference
        return first_difference(whole[:, :1], targets(FIRST[:1]), (names[0], "alone"), tolerance=TOLERANCE)

    expected = f"the same targets within {TOLERANCE}"
    checks = [attempt("no row looks at another", beside_others, expected=expected, mend=_ROWS + _DRAWS)]
    name = "rows alone, and in another order, are told the same"
    if run.drew:
        return [*checks, ContractCheck(name, None, "it draws from its generator, row by row")]
    return [*checks, attempt(name, alone, expected=expected, mend=_ROWS)]


def _hidden_truth(planner: Planner, world: PlannerWorld, batch: Batch, run: CheckedRun) -> ContractCheck:
    """Check that other labels and other 3D joints change nothing, as long as the observations are the same."""
    name = "the hidden truth changes nothing"
    if planner.privileged:
        return ContractCheck(
            name, None, "it declares privileged = True: it is handed the truth, and every table marks it"
        )
    seen = [Sensed(observation.joints_2d, observation.confidence) for observation in run.recorder.observations]
    sensor = ReplayedSensor([*seen, seen[-1]], world.runner.sensor.camera)
    other_labels = (batch.labels + 1) % len(world.runner.data.recognised_names)
    hidden = replace(batch, labels=other_labels, positions=-2 * batch.positions[::-1] + 1)
    return attempt(
        name,
        lambda: first_difference(
            run.targets,
            run_planner(planner, world, hidden, sensor=sensor).targets,
            ("at first", "with other labels and 3D joints"),
            tolerance=0,
        ),
        expected="the same targets whatever the label and the 3D joints are, as long as it is shown the same",
        mend="use the observation alone, or declare `privileged = True`, which every table marks",
    )


def _other_future(planner: Planner, world: PlannerWorld, batch: Batch, run: CheckedRun) -> ContractCheck:
    """Check that targets depend on the frames so far: the recogniser sees other frames after the middle."""
    if planner.privileged:
        return ContractCheck(FUTURE, None, "it declares privileged = True: it is handed the future")
    past = batch.positions.shape[1] // 2 + 1  # frames
    positions, noise = other_future(batch.positions, batch.noise, past)

    def other() -> str | None:
        again = run_planner(planner, world, replace(batch, positions=positions, noise=noise))
        names = ("at first", "with another future")
        return first_difference(run.targets[:past], again.targets[:past], names, tolerance=0)

    return attempt(
        FUTURE,
        other,
        expected=f"the same targets up to frame {past - 1}, after which people do something else",
        mend="use what was shown so far alone, and read nothing ahead",
    )


def _time(run: CheckedRun) -> ContractCheck:
    steps = max(run.targets.shape[0] * run.targets.shape[1], 1)
    return ContractCheck(
        f"takes {1000 * run.recorder.seconds / steps:.3g} ms for one frame of one episode, {BATCH} at a time", True
    )


def _said_changed(changed: dict[str, int]) -> str | None:
    return ", ".join(f"observation.{name} changed in frame {frame}" for name, frame in changed.items()) or None
