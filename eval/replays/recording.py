"""A replay as a recording for Rerun's viewer; this needs rerun-sdk, an optional extra, so functions import it."""

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgba

from ehar.arrays import FloatArray
from ehar.camera import look_at_rotation
from ehar.errors import UsageError
from ehar.files import replacing
from ehar.viewpoint import DISTANCE, cartesian
from eval.render.field_map import COLOUR_MAP
from eval.render.outlines import outlines
from eval.render.palette import EDGE, PAIR, PEOPLE, bone_colours
from eval.replays.episode import MAP_AZIMUTHS, TRAIL, CameraReplay, EpisodeReplay, map_polars

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

FORMAT = ".rrd"
SECONDS, FRAME = "seconds", "frame"  # the timelines; frames are counted from 1, as in a film
JOINT, BONE, PATH, TARGET, CELL = 0.04, 0.02, 0.04, 0.2, 0.12  # [m], radii
IMAGE_DISTANCE = 1.5  # [m], of the image from its camera
EVERY = 2  # step between the directions of the field map that are logged


def check_recording(path: Path | None) -> None:
    """Raise a UsageError unless a recording of this name can be written; None is any name."""
    if importlib.util.find_spec("rerun") is None:
        raise UsageError("--rerun: expected rerun-sdk to be installed, it is not: pip install -e '.[rerun]' adds it")
    if path is not None and path.suffix != FORMAT:
        raise UsageError(f"{path}: expected a Rerun recording that ends in {FORMAT}")


def write_recording(replay: EpisodeReplay, path: Path) -> None:
    """Write a recording.

    The space (`world`) holds the people and, for each planner, its camera with the image, its path, its target and its
    gain field at the camera's distance. The recording also holds the probabilities of all classes (`belief`, `bars`),
    that of the true class (`true`), and whether the true class was recognised (`right`, 0 or 1). A stream also has the
    name of what is shown (`shown`), and its centre, with everything around it, moves through the space.

    Args:
        replay: the episode.
        path: path of the recording.

    Raises:
        UsageError: the recording cannot be written.
    """
    import rerun as rr

    names = [camera.name for camera in replay.cameras]
    with replacing(path) as temporary:
        stream = rr.RecordingStream("ehar", recording_id=" ".join([replay.conditions, str(replay.index), *names]))
        stream.save(temporary, default_blueprint=_blueprint(replay))
        _log_what_stays(stream, replay)
        for frame in range(replay.frames):
            stream.set_time(FRAME, sequence=replay.first + frame + 1)
            stream.set_time(SECONDS, duration=(replay.first + frame + 1) / replay.fps)
            _log_shown(stream, replay, frame)
            _log_people(stream, replay, frame)
            for camera, look in zip(replay.cameras, PAIR, strict=False):
                _log_camera(stream, replay, camera, look.colour, frame)
                _log_belief(stream, replay, camera, frame)
        stream.disconnect()


def _log_what_stays(stream: "rr.RecordingStream", replay: EpisodeReplay) -> None:
    """Log what does not change over the episode."""
    import rerun as rr

    lines = [
        f"# {'A stream' if replay.of_streams else replay.class_names[replay.labels[0]]}",
        f"{replay.conditions}; episode {replay.index}, {replay.sequence}",
        *replay.notes,
    ]
    stream.log("about", rr.TextDocument("\n\n".join(lines), media_type="text/markdown"), static=True)
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if replay.obstacles:
        stream.log("world/obstacles", rr.LineStrips3D(outlines(replay.obstacles), colors=_rgba(EDGE)), static=True)
    for camera, look in zip(replay.cameras, PAIR, strict=False):
        colour = _rgba(look.colour)
        pinhole = rr.Pinhole(
            focal_length=replay.camera.focal_length,
            width=replay.camera.width,
            height=replay.camera.height,
            image_plane_distance=IMAGE_DISTANCE,
            color=colour,
        )
        stream.log(["world", "cameras", camera.name], pinhole, static=True)
        stream.log(["belief", camera.name], rr.SeriesLines(names=list(replay.class_names)), static=True)
        for kind in ("true", "right"):
            stream.log([kind, camera.name], rr.SeriesLines(names=camera.name, colors=colour, widths=2), static=True)


def _log_shown(stream: "rr.RecordingStream", replay: EpisodeReplay, frame: int) -> None:
    """Log the name of what a stream shows, in the first frame and where it changes."""
    import rerun as rr

    label = replay.labels[frame]
    if replay.of_streams and (frame == 0 or label != replay.labels[frame - 1]):
        stream.log("shown", rr.TextDocument(f"# {replay.class_names[label]}", media_type="text/markdown"))


def _log_people(stream: "rr.RecordingStream", replay: EpisodeReplay, frame: int) -> None:
    """Log where people are."""
    import rerun as rr

    bones = np.array(replay.skeleton.bones)
    for person, joints in enumerate(replay.positions[frame] + _origins(replay)[frame]):
        colour = _rgba(PEOPLE[person % len(PEOPLE)])
        stream.log(f"world/people/{person}/joints", rr.Points3D(joints, colors=colour, radii=JOINT))
        stream.log(f"world/people/{person}/bones", rr.LineStrips3D(joints[bones], colors=colour, radii=BONE))
    if replay.passers is not None:
        passing = (replay.passers[frame] + _origins(replay)[frame])[:, bones].reshape(-1, 2, 3)
        stream.log("world/passers", rr.LineStrips3D(passing, colors=_rgba(EDGE), radii=BONE))


def _log_camera(
    stream: "rr.RecordingStream", replay: EpisodeReplay, camera: CameraReplay, colour: str, frame: int
) -> None:
    """Log where a camera was, what it saw, where it was wanted and what directions were worth."""
    import rerun as rr

    place: list[object] = ["world", "cameras", camera.name]
    origins = _origins(replay)
    kept = slice(max(0, frame + 1 - round(TRAIL * replay.fps)) if replay.of_streams else 0, frame + 1)
    path = cartesian(camera.path[kept]) + origins[kept]
    to_world = look_at_rotation(camera.path[frame]).T  # from the camera's right, down and forward axes
    stream.log(place, rr.Transform3D(translation=path[-1], mat3x3=to_world))
    stream.log(["world", "paths", camera.name], rr.LineStrips3D([path], colors=_rgba(colour), radii=PATH))
    joints, seen = camera.joints_2d[frame], camera.seen[frame]
    bones = np.array(replay.skeleton.bones)
    found = seen[:, bones].all(axis=-1).ravel()
    persons, count = seen.shape
    joint_colours = np.array([_rgba(named) for named in bone_colours(persons, count)])[seen.ravel()]
    colours = np.array([_rgba(named) for named in bone_colours(persons, len(bones))])[found]
    stream.log([*place, "joints"], rr.Points2D(joints[seen], colors=joint_colours, radii=3.0))
    strips = joints[:, bones].reshape(-1, 2, 2)[found]
    stream.log([*place, "bones"], rr.LineStrips2D(strips, colors=colours, radii=1.5))
    wanted = camera.wanted(frame)
    target = np.empty((0, 3)) if wanted is None else cartesian(wanted)[None] + origins[frame]
    stream.log(["world", "targets", camera.name], rr.Points3D(target, colors=_rgba(colour), radii=TARGET))
    if camera.gain is not None:
        gain = camera.gain[min(frame, len(camera.gain) - 1), ::EVERY, :-1:EVERY]  # the last azimuth is the first
        shades = colormaps[COLOUR_MAP]((gain.ravel() - gain.min()) / max(np.ptp(gain), 1e-9))
        directions = _directions(camera.path[frame, DISTANCE], camera.lowest) + origins[frame]
        stream.log(["world", "fields", camera.name], rr.Points3D(directions, colors=shades, radii=CELL))


def _origins(replay: EpisodeReplay) -> FloatArray:
    """Return where the centre is in each frame, (L, 3) [m]: in a clip always at one place."""
    return np.zeros((replay.frames, 3)) if replay.centres is None else replay.centres


def _directions(distance: float, lowest: float) -> FloatArray:
    """Return the positions of a field map's logged directions at a distance [m], down to `lowest` [deg], (N, 3) [m]."""
    polars, azimuths = map_polars(lowest)[::EVERY], MAP_AZIMUTHS[:-1:EVERY]
    polar, azimuth = np.meshgrid(np.radians(polars), np.radians(azimuths), indexing="ij")
    return cartesian(np.stack([np.full(polar.shape, distance), azimuth, polar], axis=-1)).reshape(-1, 3)


def _log_belief(stream: "rr.RecordingStream", replay: EpisodeReplay, camera: CameraReplay, frame: int) -> None:
    """Log what was believed, and whether it was right."""
    import rerun as rr

    probabilities = camera.probabilities[frame]
    stream.log(["belief", camera.name], rr.Scalars(probabilities))
    stream.log(["bars", camera.name], rr.BarChart(probabilities))
    stream.log(["true", camera.name], rr.Scalars(probabilities[replay.labels[frame]]))
    stream.log(["right", camera.name], rr.Scalars(float(probabilities.argmax() == replay.labels[frame])))


def _blueprint(replay: EpisodeReplay) -> "rrb.Blueprint":
    """Return the layout of the viewer: space at the left, a column for each planner at the right."""
    import rerun as rr
    import rerun.blueprint as rrb

    columns = []
    for camera in replay.cameras:
        place = rr.new_entity_path(["world", "cameras", camera.name])
        belief, bars = (rr.new_entity_path([kind, camera.name]) for kind in ("belief", "bars"))
        columns.append(
            rrb.Vertical(
                rrb.Spatial2DView(name=f"what {camera.name} sees", origin=place),
                rrb.TimeSeriesView(name=f"what {camera.name} believes", origin=belief),
                rrb.BarChartView(name="classes", origin=bars),
            )
        )
    space = rrb.Vertical(
        rrb.Spatial3DView(name="people and cameras", origin="world"),
        rrb.Horizontal(
            rrb.TimeSeriesView(name="probability of the true class", origin="true"),
            rrb.TimeSeriesView(name="right", origin="right"),
            *([rrb.TextDocumentView(name="shown", origin="shown")] if replay.of_streams else []),
            rrb.TextDocumentView(name="about", origin="about"),
        ),
        row_shares=[3, 1],
    )
    return rrb.Blueprint(rrb.Horizontal(space, *columns, column_shares=[2, *[1] * len(columns)]), collapse_panels=True)


def _rgba(colour: str) -> list[int]:
    """Return a colour as Rerun takes it."""
    return [round(255 * share) for share in to_rgba(colour)]
