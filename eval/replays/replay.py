"""One episode of a finished run as a film, or as a Rerun recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ehar.errors import UsageError
from eval.replays.choice import ChosenEpisode, choose_episodes, choose_planners
from eval.replays.film import check_film, write_film
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run, read_run
from eval.scores.resampling.training_seeds import first_trainings

if TYPE_CHECKING:
    from eval.replays.episode import EpisodeReplay

TELLING = ("gain", "loss", "typical")  # the first three episodes of a report, in this order
MOST_PLANNERS = 2
SLOWEST = 1000.0  # a frame of a fast camera is seconds then
SLOWER = 4.0  # times slower than life: a clip lasts a second or two, too short to look at everything
MOST_FPS = {".mp4": 30.0, ".gif": 10.0}  # frames a second of a film; a GIF keeps every pixel that changes
STRETCH = 30.0  # [s], of a stream that is filmed


@dataclass(frozen=True)
class WrittenReplay:
    """A film or a recording that was written.

    Args:
        path: path of the film or the recording.
        episode: number of the episode.
        planners: planners that it shows.
        why: reasons for this episode and these planners, if the user did not choose them.
    """

    path: Path
    episode: int
    planners: tuple[str, ...]
    why: tuple[str, ...]


def make_replay(
    run: str | Path,
    episode: int | str,
    *,
    planners: Sequence[str] = (),
    out: str | Path | None = None,
    slower: float | None = None,
    since: float = 0.0,
    until: float | None = None,
    rerun: bool = False,
    data: str | Path | None = None,
    models: str | Path | None = None,
    reporter: Reporter | None = None,
) -> WrittenReplay:
    """Replay one episode of a run along its recorded path, and write it.

    Your own planners and recogniser are made again: their files, which config.json names, are run.

    Args:
        run: folder of a finished run.
        episode: counted from 0, in the order of episodes.jsonl; or `gain`, `loss`, `typical`: the one in which the
            first planner gains most or loses most against the second, or is nearest to its median, as in a report.
        planners: one or two; none takes the most accurate one that is not handed the truth, beside no-act.
        out: the file to write, .mp4 or .gif, or .rrd for Rerun; None means replay-<episode>.mp4 or .rrd in the run's
            folder.
        slower: how many times slower than life a film is; None means 4 for clips, 1 for streams.
        since: second of the episode from which it is shown.
        until: second up to which it is shown; None means the end, of a stream 30 s later at most.
        rerun: write a Rerun recording, not a film.
        data: path of the run's data; None takes the path in config.json.
        models: folder of the run's weights; None takes the folder in config.json.
        reporter: is told of progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    from eval.replays.recording import check_recording, write_recording  # imported here: it brings matplotlib

    out = None if out is None else Path(out)
    if rerun:
        check_recording(out)
    elif out is not None:
        check_film(out)
    if out is not None and not out.absolute().parent.is_dir():
        raise UsageError(f"{out}: expected a file in a folder that is there, {out.absolute().parent} is not")
    if slower is not None and not 0 < slower <= SLOWEST:
        raise UsageError(f"--slower: expected a number above 0, and at most {SLOWEST:g}, got {slower:g}")
    if len(planners) > MOST_PLANNERS or len(set(planners)) < len(planners):
        raise UsageError(f"--planners: expected one or two different planners, got {', '.join(planners)}")
    reporter = reporter or ConsoleReporter()
    finished = read_run(run)
    records, why_planners = _records(finished, planners)
    chosen = _choose(finished, episode, records)
    path = out or finished.folder / f"replay-{chosen.episode}{'.rrd' if rerun else '.mp4'}"
    replay = _replay(finished, data, models, chosen.episode, records, reporter)
    replay = _stretch(replay, since, until)
    if rerun:
        write_recording(replay, path)
    else:
        from eval.replays.figure import ReplayFigure  # imported here: it brings matplotlib

        pace = slower or (1.0 if replay.of_streams else SLOWER)
        every = max(1, round(replay.fps / pace / MOST_FPS[path.suffix]))
        draw = ReplayFigure(replay, pace).draw
        frames = -(-replay.frames // every)
        write_film(lambda frame: draw(frame * every), frames, replay.fps / pace / every, path)
    return WrittenReplay(path, chosen.episode, records, tuple(why for why in (why_planners, chosen.why) if why))


def _stretch(replay: "EpisodeReplay", since: float, until: float | None) -> "EpisodeReplay":
    """Return the part of an episode that is shown.

    Raises:
        UsageError: no two frames of it lie in that time.
    """
    lasts = replay.frames / replay.fps
    end = until if until is not None else since + STRETCH if replay.of_streams else lasts
    told = 0 <= since < lasts and end > since  # neither is NaN, and only the end may be infinite
    frames = (round(since * replay.fps), round(min(end, lasts) * replay.fps)) if told else (0, 0)
    if not frames[0] < frames[1] - 1:
        raise UsageError(f"--since, --until: expected two times from 0 to {lasts:g} s, got {since:g} and {end:g}")
    return replay if frames == (0, replay.frames) else replay.cut(*frames)


def _records(run: Run, planners: Sequence[str]) -> tuple[tuple[str, ...], str]:
    """Return the record names of the planners to show, and the reason if the user named none."""
    if planners:
        return tuple(run.record_name(name) for name in planners), ""

    lead = run.summary.lead
    shown = choose_planners(list(first_trainings(run.records)), lead)
    reason = (
        f"{lead} is the most accurate planner that moves, without the truth" if lead else f"{shown[0]} is the first"
    )
    return tuple(run.record_name(name) for name in shown), reason


def _choose(run: Run, episode: int | str, records: Sequence[str]) -> ChosenEpisode:
    """Return the chosen episode, and the reason if the user did not give its number."""
    count = len(run.records[records[0]])
    expected = f"episode: expected 0 to {count - 1}, or {', '.join(TELLING)}"
    if isinstance(episode, str) and episode in TELLING:
        if len(records) < MOST_PLANNERS:
            raise UsageError(f"episode: {episode} compares two planners, got {records[0]} alone")
        chosen = choose_episodes({name: run.records[name] for name in records}, *records, most=len(TELLING))
        rank = TELLING.index(episode)
        if rank >= len(chosen):
            raise UsageError(f"episode: {episode} needs {rank + 1} episodes to choose from, the run has {len(chosen)}")
        return chosen[rank]
    try:
        index = int(episode)
    except ValueError as error:
        raise UsageError(f"{expected}, got {episode!r}") from error
    if not 0 <= index < count:
        raise UsageError(f"{expected}, got {index}")
    return ChosenEpisode(index, "")


def _replay(
    run: Run,
    data: str | Path | None,
    models: str | Path | None,
    index: int,
    records: Sequence[str],
    reporter: Reporter,
) -> "EpisodeReplay":
    """Return an episode, and note what is missing."""
    from eval.replays.episode import replay_episode  # imported here: it brings rich
    from eval.verification.inputs import check_inputs

    reporter.begin(len(records))
    try:
        inputs = check_inputs(run.config, data, models, run_own_code=True)
        replay = replay_episode(run, inputs, index, records, advance=reporter.advance)
    finally:
        reporter.end()
    for note in replay.notes:
        reporter.note(note)
    return replay
