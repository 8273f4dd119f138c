"""The report of a finished run: one HTML file, which needs neither a server nor a network."""

import json
from collections.abc import Callable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from ehar.errors import EharError
from ehar.files import write_text
from ehar.version import __version__
from eval.records.one_by_one import OneByOne
from eval.render.palette import DARK, LIGHT
from eval.replays.choice import MOST, MOST_STREAMS, OF_CLIPS, RULE, RULE_ALONE, choose_episodes, choose_planners
from eval.replays.data import replay_data
from eval.reports.data import ReportData, report_data
from eval.reports.section import drawn, links, section_html
from eval.reports.sections import SECTIONS
from eval.reports.stream_sections import STREAM_SECTIONS
from eval.reports.tables import (
    options,
    picker,
    planner_table,
    stream_tables,
    what_ran,
)
from eval.reports.timelines import timelines
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import class_names, stored_run
from eval.scores.closing import closing_sentences
from eval.scores.planner_summary import NO_ACT
from eval.scores.resampling.training_seeds import first_trainings

REPORT = "report.html"
SCRIPTS = (
    *("theme.js", "figures.js", "tables.js", "codec.js", "canvas.js", "scene.js", "views.js", "timeline.js"),
    "replay.js",
)
_COURSE = "Probability of the true class [%] over the episode."
_STREAM_COURSE = (
    "What is shown and what is believed; a bar below the answers marks wrong ones. Below: the probability of the true "
    "class, and where the cameras are. Click to go to a moment."
)
_STREAM_TRAIL = (
    " The view follows the centre, a small ring, which follows the people; the dotted line is its way on the ground in "
    "the last 10 s. Paths are those of the last 5 s."
)
PAGE = files("eval.reports") / "assets"


def make_report(
    run: str | Path,
    *,
    out: str | Path | None = None,
    data: str | Path | None = None,
    models: str | Path | None = None,
    reporter: Reporter | None = None,
) -> Path:
    """Write the report of a finished run, and return its path.

    Args:
        run: folder of a finished run.
        out: the file to write; None means report.html in the run's folder.
        data: path of the run's data; None takes the path in config.json.
        models: folder of the run's weights; None takes the folder in config.json.
        reporter: is told of progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    reporter = reporter or ConsoleReporter()
    finished = stored_run(run)
    _ = finished.summary  # first, so that one which is damaged is all that is heard of
    shown = report_data(finished, class_names(finished, reporter.note, data))
    replays, rule = _replays(shown, data, models, reporter)
    lines = _timelines(shown, replays, data) if shown.of_streams else None
    path = finished.folder / REPORT if out is None else Path(out)
    write_text(path, [page(shown, replays, rule, lines)])
    return path


def page(data: ReportData, replays: dict[str, Any], rule: str, lines: dict[str, Any] | None = None) -> str:
    """Return the report as HTML.

    Args:
        data: data of the report.
        replays: result of `replay_data`.
        rule: rule that chose the replayed episodes.
        lines: result of `timelines`; None for clips.
    """
    from plotly.offline import get_plotlyjs  # imported here: 5 MB that nothing else needs

    names = list(data.planners)
    focus = data.lead or names[0]
    sections = STREAM_SECTIONS if data.of_streams else SECTIONS
    return Template(_read("page.html")).substitute(
        title=escape(data.run.config.title),
        style=f"{_themes()}\n{_read('style.css')}",
        lead=escape(closing_sentences(data.summary)),
        ran=what_ran(data),
        table=planner_table(data) + stream_tables(data),
        replay=_replay_part(data, replays, rule),
        focus=picker("focus", "Planner in focus, in all figures below", names, focus),
        links=links(sections),
        sections="\n\n".join(section_html(section, data) for section in sections),
        footer=escape(f"Made by ehar {__version__}. Every number is in summary.json, or computed from episodes.jsonl."),
        report_json=for_script(drawn(sections, data)),
        replays_json=for_script(replays),
        timelines_json=for_script(lines),
        plotly=get_plotlyjs(),
        script="\n".join(_read(name) for name in SCRIPTS),
    )


def for_script(value: Any) -> str:
    """Return JSON that is safe in a script element: no string in it can end the element."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _replays(
    data: ReportData, source: str | Path | None, models: str | Path | None, reporter: Reporter
) -> tuple[dict[str, Any], str]:
    """Return the replays of the most telling episodes, and the rule that chose them."""
    shown = first_trainings(data.run.records)
    records = OneByOne(list(shown), lambda name: data.run.records[shown[name]])
    led = data.lead if NO_ACT in records else None
    most = MOST_STREAMS if data.of_streams else MOST
    chosen = choose_episodes(records, led, NO_ACT if led else None, most=most)
    rule = RULE_ALONE if led is None else RULE.format(planner=led, other=NO_ACT)
    rule += "" if data.of_streams else OF_CLIPS
    reporter.begin(len(shown))
    advance: Callable[[str], None] = reporter.advance
    try:
        replays = replay_data(data.run, chosen, shown, data=source, models=models, advance=advance)
    finally:
        reporter.end()
    if replays["missing"]:
        reporter.note(f"the report has no replays: {replays['missing']}")
    seeds = [name for name, record in shown.items() if name != record]
    if seeds:
        rule += f". Of {', '.join(seeds)} the first training seed is shown"
    return replays, rule


def _timelines(data: ReportData, replays: dict[str, Any], source: str | Path | None) -> dict[str, Any]:
    """Return the timelines of a run of streams; without its data, they do not know where people face."""
    from ehar.data.any_source import load_recordings  # imported here: it brings scipy

    told = data.run.conditions
    try:
        recordings = load_recordings(str(told.data if source is None else source), fps=told.fps)
    except EharError:
        recordings = None
    if recordings is not None and recordings.sha256 != data.run.config.data_sha256:
        recordings = None
    return timelines(data, [episode["episode"] for episode in replays["episodes"]], recordings)


def _replay_part(data: ReportData, replays: dict[str, Any], rule: str) -> str:
    """Return the replay's controls, or why there is none."""
    if replays["missing"]:
        return (
            '<p class="notice">There are no replays: they need the data and the recogniser of the run. '
            f"{escape(replays['missing'])}</p>"
        )
    label = data.reference.label
    episodes = {
        str(row): ("" if data.of_streams else f"{data.class_names[label[episode['episode']]]}: ")
        + f"{episode['title']} (episode {episode['episode']})"
        for row, episode in enumerate(replays["episodes"])
    }
    names = list(data.planners)
    first, second = (*choose_planners(names, data.lead), "")[:2]
    count = len(data.reference)
    told = f"Shown are {len(episodes)} of {count} episodes, {rule}."
    notes = "".join(f"<li>{escape(note)}</li>" for note in replays["notes"])
    sensor = data.run.conditions.sensor
    seer = "the estimator" if sensor == "estimator" else f"the sensor {sensor}"
    return Template(_read("replay.html")).substitute(
        rule=escape(told),
        episodes=options(episodes, "0"),
        first=options(names, first),
        second=options({"": "nobody", **{name: name for name in names}}, second),
        last=replays["frames"] - 1,
        course="" if data.of_streams else _course_html(_COURSE),
        below=_course_html(_STREAM_COURSE) if data.of_streams else "",
        trail=_STREAM_TRAIL if data.of_streams else "",
        notes=f'<ul class="notes">{notes}</ul>' if notes else "",
        sensor="" if sensor == "perfect" else f": joints as {escape(seer)} reports them, missed ones left out",
    )


def _course_html(told: str) -> str:
    """Return where the course of an episode is drawn, and what it shows."""
    return f'<canvas id="course" role="img" aria-label="{escape(told)}"></canvas>\n<p class="small">{escape(told)}</p>'


def _themes() -> str:
    """Return the colours of the page, light and dark, as CSS."""
    dark = f"@media (prefers-color-scheme: dark) {{ :root {{ {DARK.css()} }} }}"
    return f":root {{ {LIGHT.css()} }}\n{dark}"


def _read(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")
