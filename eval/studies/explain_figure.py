"""An explained episode as a picture: gain fields with the path over them, beliefs below, and the course of both."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, withStroke

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.files import replacing
from ehar.viewpoint import AZIMUTH, POLAR
from eval.render.field_map import COLOUR_MAP
from eval.render.palette import LINE, NEUTRAL, PEOPLE, RIGHT, STRONG, TEXT, THIN, VERMILION, YELLOW
from eval.studies.explanation import Explanation

FORMATS = (".png", ".svg", ".pdf")
NARROWEST = 10.0  # [inch], width of a picture, so that its titles have room
MOST_CLASSES = 10  # classes with a bar
LABELS = {0: "0° above", 30: "30°", 60: "60°", 90: "90° level"}  # of polar angles
TURNS = (
    -360.0,
    0.0,
    360.0,
)  # [deg]: lines are drawn three times, so that a line that leaves the map enters on the other side

_TRUE, _OTHER, _RECOGNISER = VERMILION, NEUTRAL, TEXT
_OUTLINE = (withStroke(linewidth=4.5, foreground="black"), Normal())


def draw_explanation(explanation: Explanation, path: Path) -> None:
    """Draw an explained episode.

    Args:
        explanation: the episode.
        path: the picture to write; its ending decides the format.

    Raises:
        UsageError: the ending is not in `FORMATS`, or the file cannot be written.
    """
    check_format(path)
    columns, bars = len(explanation.moments), shown_classes(explanation)
    bar_height = 0.35 + 0.19 * len(bars)  # [inch]
    heights = (2.1, 0.7, bar_height, 0.55, 1.2)
    figure = Figure(figsize=(max(1.8 + 3.3 * columns, NARROWEST), sum(heights) + 2.2), layout="constrained")
    grid = figure.add_gridspec(
        len(heights), columns + 1, height_ratios=heights, width_ratios=(*[1.0] * columns, 0.05 + 0.02 / columns)
    )
    colours = figure.add_subplot(grid[0, columns])
    _draw_maps(explanation, [figure.add_subplot(grid[0, column]) for column in range(columns)], colours)
    _draw_key(figure.add_subplot(grid[1, :columns]), _map_key(explanation.facing.shape[1], explanation.ahead))
    _draw_beliefs(explanation, bars, [figure.add_subplot(grid[2, column]) for column in range(columns)])
    _draw_key(figure.add_subplot(grid[3, :columns]), _belief_key(len(explanation.class_names) - len(bars)))
    _draw_course(explanation, figure.add_subplot(grid[4, :columns]))
    figure.suptitle(
        f"{explanation.title}: {explanation.sequence}\n"
        f"{explanation.planner} looks at {explanation.subject}: {explanation.outcome}",
        fontsize=12,
    )
    FigureCanvasAgg(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=140)


def check_format(path: Path) -> None:
    """Raise a UsageError unless the path ends like a picture that can be drawn."""
    if path.suffix not in FORMATS:
        raise UsageError(f"{path}: expected a picture that ends in {', '.join(FORMATS)}")


def shown_classes(explanation: Explanation) -> list[int]:
    """Return the classes with a bar, at most `MOST_CLASSES`: the most believed ones at any moment shown.

    The true classes are among them. The order is that of the data, so that columns can be compared.
    """
    most = explanation.believed[explanation.moments].max(axis=0)
    most[explanation.labels[explanation.moments]] = np.inf
    return sorted(np.argsort(-most, kind="stable")[:MOST_CLASSES].tolist())


def _draw_maps(explanation: Explanation, axes: list[Any], colours: Any) -> None:
    """Draw the gain field at each moment, the path of the camera, and the directions that people face."""
    maps = [explanation.field_map(frame) for frame in explanation.moments]
    low = 100 * min(field.gain.min() for field in maps)
    high = 100 * max(field.gain.max() for field in maps)
    for place, frame, field in zip(axes, explanation.moments, maps, strict=True):
        mesh = place.pcolormesh(
            field.azimuth, field.polar, 100 * field.gain, cmap=COLOUR_MAP, vmin=low, vmax=high, rasterized=True
        )
        place.contour(
            field.azimuth, field.polar, field.gain, levels=[0.0], colors="white", linewidths=THIN, linestyles="-"
        )
        _draw_path(explanation, frame, place)
        row, column = field.best
        place.plot(
            field.azimuth[column],
            field.polar[row],
            "*",
            color=YELLOW,
            markersize=15,
            markeredgecolor="black",
            clip_on=False,
            zorder=6,
        )
        _draw_facing(explanation, frame, place)
        share = 100 * (frame + 1) / len(explanation.viewpoints)
        when = f"frame {explanation.when(frame)} ({share:.0f} %)"
        if explanation.ahead is not None:
            when = f"{explanation.when(frame)} s, {explanation.class_names[explanation.labels[frame]]}"
        place.set_title(f"{when}, camera at {explanation.viewpoints[frame, 0]:.1f} m", fontsize=10)
        place.set_xlim(0, 360)
        place.set_ylim(field.polar[-1], field.polar[0])
        place.set_xticks(range(0, 361, 90), [f"{angle}°" for angle in range(0, 361, 90)])
        place.set_xlabel("azimuth")
        place.tick_params(axis="x", pad=8 + 7 * explanation.facing.shape[1])
        place.set_yticks([angle for angle in LABELS if field.polar[0] <= angle <= field.polar[-1]], [])
    shown = [angle for angle in LABELS if field.polar[0] <= angle <= field.polar[-1]]
    axes[0].set_yticks(shown, [LABELS[angle] for angle in shown])
    axes[0].set_ylabel("polar angle")
    colours.figure.colorbar(mesh, cax=colours)
    colours.set_ylabel("gained probability [%]\nof looking from there, not here", fontsize=9)


def _draw_path(explanation: Explanation, frame: int, place: Any) -> None:
    """Draw the camera, its path so far, its target, and its path from here on."""
    path = np.degrees(np.unwrap(explanation.viewpoints[:, AZIMUTH])), np.degrees(explanation.viewpoints[:, POLAR])
    azimuth, polar = path[0] - path[0][frame] + path[0][frame] % 360, path[1]
    target = np.degrees(explanation.targets[frame])
    before, after = slice(max(frame - explanation.reach, 0), frame + 1), slice(frame, frame + explanation.reach + 1)
    way = (target[AZIMUTH] - azimuth[frame] + 180) % 360 - 180
    for turn in TURNS:
        place.plot(azimuth[after] + turn, polar[after], ":", color="white", linewidth=LINE, path_effects=_thin())
        place.plot(azimuth[before] + turn, polar[before], color="white", linewidth=STRONG, path_effects=_OUTLINE)
        here = azimuth[frame] + turn, polar[frame]
        if np.hypot(way, target[POLAR] - polar[frame]) > 1:
            place.annotate(
                "",
                (here[0] + way, target[POLAR]),
                here,
                arrowprops={
                    "arrowstyle": "-|>,head_width=0.35,head_length=0.7",
                    "color": "black",
                    "linewidth": 2,
                    "shrinkA": 5,
                    "shrinkB": 0,
                },
                annotation_clip=True,
                zorder=7,
            )
        place.plot(*here, "o", color="white", markeredgecolor="black", markeredgewidth=1.5, markersize=9, zorder=8)


def _thin() -> tuple[Any, ...]:
    return withStroke(linewidth=3, foreground="black"), Normal()


def _draw_facing(explanation: Explanation, frame: int, place: Any) -> None:
    """Mark below the map the direction that each person is believed to face, with one standard deviation."""
    bottom = place.get_xaxis_transform()
    azimuths, spreads = np.degrees(explanation.facing[frame]), np.degrees(explanation.facing_std[frame])
    for person, (azimuth, spread) in enumerate(zip(azimuths % 360, spreads, strict=True)):
        colour, height = PEOPLE[person % len(PEOPLE)], -0.06 - 0.065 * person
        for turn in TURNS:
            ends = np.clip([azimuth + turn - spread, azimuth + turn + spread], 0, 360)
            if ends[1] > ends[0]:
                place.plot(ends, [height, height], color=colour, linewidth=3, transform=bottom, clip_on=False)
        place.plot(
            azimuth,
            height,
            "^",
            color=colour,
            markeredgecolor="black",
            markersize=9,
            transform=bottom,
            clip_on=False,
            zorder=6,
        )


def _map_key(persons: int, ahead: float | None) -> list[Any]:
    """Return the entries of the legend below the maps, which show the whole path, or so many seconds of it."""
    before, after = "path so far", "path from here on"
    if ahead is not None:
        before, after = f"path of the last {ahead:g} s", f"of the next {ahead:g} s"
    black = {"markeredgecolor": "black", "linestyle": "none"}
    people = [
        Line2D([], [], marker="^", color=colour, markersize=9, label=f"person {person + 1} faces", **black)  # type: ignore[arg-type]
        for person, colour in zip(range(persons), PEOPLE, strict=False)
    ]
    return [
        Line2D([], [], marker="o", color="white", markersize=9, label="camera", **black),  # type: ignore[arg-type]
        Line2D([], [], color="white", linewidth=STRONG, path_effects=_OUTLINE, label=before),
        Line2D([], [], color="black", marker=">", linewidth=2, label="heads for"),
        Line2D([], [], color="white", linestyle=":", linewidth=LINE, path_effects=_thin(), label=after),
        Line2D([], [], color="white", linewidth=THIN, path_effects=_thin(), label="as good as here"),
        Line2D([], [], marker="*", color=YELLOW, markersize=14, label="best view at this distance", **black),  # type: ignore[arg-type]
        *people,
    ]


def _draw_beliefs(explanation: Explanation, bars: list[int], axes: list[Any]) -> None:
    """Draw the belief at each moment, with the true class marked, and the probabilities of the recogniser."""
    places = np.arange(len(bars))
    for place, frame in zip(axes, explanation.moments, strict=True):
        colours = [_TRUE if label == explanation.labels[frame] else _OTHER for label in bars]
        believed: FloatArray = 100 * explanation.believed[frame, bars]
        place.barh(places, believed, color=colours, height=0.72)
        recognised = 100 * explanation.recognised[frame, bars]
        place.plot(recognised, places, "|", color=_RECOGNISER, markersize=11, markeredgewidth=2, clip_on=False)
        for height, share, mark in zip(places, believed, recognised, strict=True):
            if share >= 0.5:
                behind = (max(share, mark), height)
                place.annotate(f"{share:.0f}", behind, (5, 0), textcoords="offset points", va="center", fontsize=8)
        place.set_xlim(0, 100)
        place.set_ylim(len(bars) - 0.4, -0.6)
        place.spines[["top", "right"]].set_visible(False)
        place.set_xlabel("believed [%]", fontsize=9)
        place.set_yticks(places, [])
    axes[0].set_yticks(places, [explanation.class_names[label] for label in bars], fontsize=9)
    for name, label in zip(axes[0].get_yticklabels(), bars, strict=True):
        if (explanation.labels[explanation.moments] == label).all():
            name.set(fontweight="bold", color=_TRUE)


def _belief_key(left: int) -> list[Any]:
    """Return the entries of the legend below the bars; `left` classes have no bar."""
    return [
        Patch(color=_TRUE, label="true class"),
        Patch(color=_OTHER, label=f"other classes ({left} not shown)" if left else "other classes"),
        Line2D([], [], marker="|", color=_RECOGNISER, linestyle="none", markersize=11, label="recogniser"),
    ]


def _draw_key(place: Any, handles: list[Any]) -> None:
    """Draw a legend that fills a row."""
    place.axis("off")
    wide = place.figure.get_figwidth() > 1.3 * NARROWEST
    columns = len(handles) if wide else -(-len(handles) // 2)
    key = place.legend(handles=handles, loc="center", ncols=columns, fontsize=9, frameon=False)
    key.set_in_layout(False)  # it may be wider than the row above it


def _draw_course(explanation: Explanation, place: Any) -> None:
    """Draw the probability of the true class in each frame, when it was recognised, and the moments shown."""
    frames, stream = np.arange(1.0, len(explanation.viewpoints) + 1), explanation.ahead is not None
    if stream:
        frames = (frames - 1) * explanation.frame_time
        _name_activities(explanation, frames, place)
    place.fill_between(
        frames, 0, 100, where=explanation.right, step="mid", color=RIGHT, linewidth=0, label="recognised rightly"
    )
    place.plot(
        frames,
        100 * explanation.of_true(explanation.recognised),
        color=_RECOGNISER,
        linewidth=LINE,
        label="recogniser",
    )
    believed = 100 * explanation.of_true(explanation.believed)
    label = f"belief, of the coming {explanation.expected:g} s" if stream else "belief"
    place.plot(frames[:-1], believed, color=_TRUE, linewidth=STRONG, label=label)
    for frame in explanation.moments:
        place.axvline(frames[frame], color=_OTHER, linewidth=THIN, linestyle="--", zorder=1)
    place.set_xlim(frames[0], frames[-1])
    place.set_ylim(0, 100)
    place.set_xlabel(f"{'time [s]' if stream else 'frame'} (dashed: the moments above)")
    place.set_ylabel("true class [%]")
    place.spines[["top", "right"]].set_visible(False)
    place.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=9, frameon=False)


def _name_activities(explanation: Explanation, times: FloatArray, place: Any) -> None:
    """Write the names of a stream's activities above the course, each where it is shown."""
    edges = np.flatnonzero(np.diff(explanation.labels, prepend=-1, append=-1))
    for begin, end in itertools.pairwise(edges):
        label, middle = explanation.labels[begin], times[(begin + end - 1) // 2]
        place.axvline(times[begin], color=_OTHER, linewidth=THIN, zorder=1)
        if label < len(explanation.class_names) - 1:
            name = explanation.class_names[label]
            place.annotate(
                name,
                (middle, 1),
                (0, 2),
                xycoords=place.get_xaxis_transform(),
                fontsize=8,
                ha="center",
                textcoords="offset points",
                annotation_clip=False,
            )
