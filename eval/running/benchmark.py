"""The benchmark: planners on the same episodes, with the same recogniser, sensor and seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of
from ehar.errors import UsageError
from ehar.files import write_text
from ehar.planner import Planner
from ehar.recogniser import Recogniser
from ehar.sensors.sensor import Sensor
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import RunConfig, check_out, installed_versions, planner_config, write_run
from eval.running.accuracy_kept import read_ideal_run
from eval.running.choice import READOUTS, ModelPlace, check_planners, choose_planners
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Interrupted, PlannerRun, World, run_planners
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.tracks import IDEAL, load_track, track_name
from eval.scores.summary import Summary, summarise
from eval.scores.training_seeds import curves
from recognition.own_recogniser import resolve_recogniser
from recognition.training.config import FORMS, Form
from recognition.training.views import REGIMES


def benchmark(
    planners: Sequence[str | Planner] | None = None,
    *,
    data: str | Path | MotionData = "duo",
    models: Path | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    form: Form = "causal",
    recogniser: str | Recogniser | None = None,
    track: str = IDEAL,
    ideal: Path | None = None,
    readout: str = "recogniser",
    part: str = "test",
    starts: int = 1,
    seed: int = 0,
    length: int = 60,
    fps: float | None = None,
    out: Path | None = None,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> Summary:
    """Run planners on the test scenarios of some data, and say how well each did.

    Args:
        planners: names or classes as `planners.registry.resolve_planner` knows them, or planners of your own; None
            runs every planner of ours that can run: those that value views are left out, and the reporter told so,
            where nothing was trained for that.
        data: `duo`, `solo`, the path of a prepared .npz, or data in memory.
        models: folder of recogniser weights; None takes those that ship with ehar, for `duo` and `solo`.
        sensor: `perfect` or `estimator`.
        views: the cameras that the recogniser was trained on, `moving` or `paper`.
        form: of the recogniser: `causal` streams, `ctrgcn` is the published network on every prefix (slow).
        recogniser: one of your own in place of a trained one: an object, or a class as
            `recognition.own_recogniser.resolve_recogniser` knows it. Planners that were trained for ours do not run.
        track: how cameras move: `ideal` is the paper's grid; the name of a vehicle, or a vehicle file.
        ideal: folder of a finished run on the ideal track under the same conditions; says how much accuracy the
            flights kept.
        readout: whose probabilities are scored, the `recogniser`'s or those of the `belief`, which were fitted on
            the policy part of the training data; planners act the same with either.
        part: whose scenarios: `test`; or to develop on `validation`, or `policy` or `recogniser`, on which something
            was trained.
        starts: start viewpoints for each scenario.
        seed: of start viewpoints, the sensor's noise and the planners' own draws.
        length: L, frames in an episode.
        fps: frame rate to resample to [1/s]; None keeps the data's.
        out: folder for config.json, episodes.jsonl, summary.json, table.md and the accuracy curve.
        workers: processes; the numbers are the same with any number.
        reporter: hears of progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
        KeyboardInterrupt: after what was finished has been written to `out`.
    """
    reporter = reporter or ConsoleReporter()
    check_options(readout=readout, starts=starts, seed=seed, workers=workers)
    check_planners(planners)
    vehicle = load_track(track)
    setting = load_setting(
        data=data, models=models, sensor=sensor, views=views, form=form, recogniser=recogniser, fps=fps
    )
    scenarios = cut_scenarios(setting.data, part_of(setting.data, part), length, reporter.note)
    place = ModelPlace(
        models=None if models is None else Path(models),
        data=setting.data,
        sensor=sensor,
        views=views,
        form=setting.form,
        recogniser_sha256=setting.recogniser_sha256,
    )
    chosen, origins, model = choose_planners(planners, place, readout=readout, note=reporter.note)
    config = RunConfig(
        source=setting.source,
        data=setting.data.title,
        data_sha256=setting.data.sha256,
        models=None if models is None else str(models),
        recogniser_sha256=setting.recogniser_sha256,
        sensor=sensor,
        views=views,
        form=setting.form,
        recogniser=setting.recogniser_spec,
        track=track_name(vehicle),
        vehicle=vehicle,
        readout=readout,
        part=part,
        gain_model_sha256=None if model is None else model.sha256,
        starts=starts,
        seed=seed,
        length=length,
        fps=fps,
        ideal=None if ideal is None else str(ideal),
        planners=tuple(planner_config(planner, origins.get(planner.name)) for planner in chosen),
        versions=installed_versions(),
    )
    if out is not None:
        check_out(Path(out), asdict(config))
    on_ideal = None if ideal is None else read_ideal_run(Path(ideal), config)
    belief = model.belief if model is not None and readout == "belief" else None
    world = World(random_starts(scenarios, starts, seed), setting.recogniser, setting.sensor, vehicle, belief)
    try:
        runs = run_planners(world, chosen, workers=workers, reporter=reporter)
    except Interrupted as interrupted:
        kept = _keep_finished(interrupted.runs, world, config, out, on_ideal)
        raise KeyboardInterrupt(kept) from None
    summary = _summarise_runs(runs, config, on_ideal)
    if out is not None:
        _write_all(Path(out), config, runs, summary, classes=len(setting.data.class_names))
    return summary


@dataclass(frozen=True, eq=False)
class Setting:
    """What planners are compared in: motion, and the recogniser and sensor that fit it."""

    source: str
    data: MotionData
    recogniser: Recogniser
    recogniser_sha256: str
    sensor: Sensor
    form: str  # of the recogniser; of one's own, what tables call it
    recogniser_spec: str | None = None  # how one's own was named


def load_setting(
    *,
    data: str | Path | MotionData,
    models: Path | None,
    sensor: str,
    views: str,
    form: Form,
    fps: float | None,
    recogniser: str | Recogniser | None = None,
) -> Setting:
    """Load data, recogniser and sensor; the arguments are those of `benchmark`."""
    # Here, as they bring torch, which `ehar --help` does not wait for.
    from ehar.data.source import load_data
    from ehar.sensors.estimator import make_sensor
    from recognition.storage import load_recogniser

    if views not in REGIMES:
        raise UsageError(f"unknown views {views!r}; expected {' or '.join(REGIMES)}")
    if form not in FORMS:
        raise UsageError(f"unknown form {form!r}; expected {' or '.join(FORMS)}")
    if isinstance(data, MotionData):
        motion = data if fps is None else data.resampled(fps)
    else:
        motion = load_data(data, fps=fps)
    source = data.name if isinstance(data, MotionData) else str(data)
    eye = make_sensor(sensor, motion.skeleton)
    if recogniser is not None:
        if form != "causal":
            raise UsageError(f"form: expected none beside a recogniser of your own, got {form}")
        own = resolve_recogniser(recogniser, motion)
        return Setting(source, motion, own.recogniser, own.sha256, eye, own.title, own.spec)
    directory = None if models is None else Path(models)
    trained = load_recogniser(directory, motion, sensor=sensor, views=views, form=form)
    return Setting(source, motion, trained, trained.sha256, eye, form)


def check_options(*, readout: str = "recogniser", starts: int = 1, seed: int, workers: int) -> None:
    """Raise a UsageError if the readout is unknown or a number is too small."""
    if readout not in READOUTS:
        raise UsageError(f"unknown readout {readout!r}; expected {' or '.join(READOUTS)}")
    for name, value, least in (("starts", starts, 1), ("seed", seed, 0), ("workers", workers, 1)):
        if value < least:
            raise UsageError(f"{name}: expected at least {least}, got {value}")


def _summarise_runs(
    runs: dict[str, PlannerRun], config: RunConfig, on_ideal: Mapping[str, EpisodeRecords] | None
) -> Summary:
    return summarise(
        {name: run.records for name, run in runs.items()},
        config.conditions,
        privileged={planner.name: planner.privileged for planner in config.planners},
        step_ms={name: run.step_ms for name, run in runs.items()},
        solves={name: run.solves for name, run in runs.items()},
        on_ideal=on_ideal,
    )


def _keep_finished(
    runs: dict[str, PlannerRun],
    world: World,
    config: RunConfig,
    out: Path | None,
    on_ideal: Mapping[str, EpisodeRecords] | None,
) -> str:
    """Write what was finished when the user stopped the run, and return a line that says what was kept."""
    finished = {name: run for name, run in runs.items() if run.chunks == world.episodes.chunks}
    if out is None or not runs:
        return "nothing was written"
    summary = _summarise_runs(finished, config, on_ideal) if finished else None
    write_run(Path(out), config, {name: run.records for name, run in runs.items()}, summary)
    episodes = sum(len(run.records) for run in runs.values())
    covered = (
        f"its summary covers the {len(finished)} of {len(config.planners)} planners that ran all of theirs"
        if finished
        else "without a summary, as no planner ran all of its own"
    )
    return f"{episodes} finished episodes are in {out}; {covered}"


def _write_all(out: Path, config: RunConfig, runs: dict[str, PlannerRun], summary: Summary, *, classes: int) -> None:
    """Write records, summary, table and figure."""
    from eval.render.figures import draw_accuracy  # matplotlib takes a second to import
    from eval.render.summary_table import markdown_summary

    records = {name: run.records for name, run in runs.items()}
    write_run(out, config, records, summary)
    write_text(out / "table.md", [markdown_summary(summary)])
    draw_accuracy(curves(records), summary, classes, out / "accuracy")
