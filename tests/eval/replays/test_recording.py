from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.errors import UsageError
from ehar.obstacles import Box, Obstacles
from ehar.viewpoint import cartesian
from eval.render.outlines import outlines
from eval.replays.episode import MAP_AZIMUTHS, EpisodeReplay, map_polars
from eval.replays.recording import check_recording, write_recording
from tests.helpers.fakes import CLASS_NAMES, SKELETON
from tests.helpers.replays import FRAMES, PERSONS, camera_replay, known_replay

chunk = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[Any]]]:
    return held_by(known_replay(), tmp_path_factory.mktemp("recording") / "a.rrd")


def held_by(replay: EpisodeReplay, path: Path) -> dict[str, dict[str, list[Any]]]:
    """Return what a recording holds: by entity, its columns as lists over frames."""
    write_recording(replay, path)
    assert [file.name for file in path.parent.iterdir()] == ["a.rrd"]
    reader = chunk.RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    held: dict[str, dict[str, list[Any]]] = {}
    pieces = sorted((piece.to_record_batch() for piece in reader.stream()), key=first_frame)
    for batch in pieces:  # it is written in pieces, in no order
        columns = held.setdefault(batch.schema.metadata[b"rerun:entity_path"].decode(), {})
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if name not in ("log_time", "rerun.controls.RowId"):
                values = column.cast("int64") if name == "seconds" else column  # [ns]
                columns.setdefault(name, []).extend(values.to_pylist())
    return held


def first_frame(batch: Any) -> int:
    return int(batch["frame"][0].as_py()) if "frame" in batch.schema.names else 0


def test_every_frame_has_its_number_and_its_time(recorded: dict[str, dict[str, list[Any]]]) -> None:
    moving = {name: entity for name, entity in recorded.items() if "frame" in entity}
    assert (
        len(moving) == 2 * PERSONS + 2 * 5 + 1 + 2 * 4
    )  # people; cameras, what they see, paths, targets; a field; beliefs
    for entity in moving.values():
        assert entity["frame"] == list(range(1, FRAMES + 1))
        np.testing.assert_allclose(entity["seconds"], 1e9 * np.arange(1, FRAMES + 1) / 25)


def test_people_are_where_they_were(recorded: dict[str, dict[str, list[Any]]]) -> None:
    positions = known_replay().positions
    for person in range(PERSONS):
        joints = np.array(recorded[f"/world/people/{person}/joints"]["Points3D:positions"])
        np.testing.assert_allclose(joints, positions[:, person], rtol=1e-6)
        bones = np.array(recorded[f"/world/people/{person}/bones"]["LineStrips3D:strips"])
        np.testing.assert_allclose(bones, positions[:, person][:, np.array(SKELETON.bones)], rtol=1e-6)


def test_a_camera_sees_through_its_pinhole_what_was_sensed(recorded: dict[str, dict[str, list[Any]]]) -> None:
    camera, held = known_replay().cameras[0], recorded["/world/cameras/spiral"]
    intrinsics = np.array(held["Pinhole:image_from_camera"]).reshape(3, 3).T  # Rerun stores columns first
    seen = recorded["/world/cameras/spiral/joints"]["Points2D:positions"]
    for frame in range(FRAMES):
        translation = np.array(held["Transform3D:translation"][frame][0])
        np.testing.assert_allclose(translation, cartesian(camera.path[frame]), rtol=1e-6)
        to_world = np.array(held["Transform3D:mat3x3"][frame]).reshape(3, 3).T
        people = known_replay().positions[frame].reshape(-1, 3)
        in_image = intrinsics @ np.linalg.inv(to_world) @ (people - translation).T
        np.testing.assert_allclose(seen[frame], (in_image[:2] / in_image[2]).T, atol=0.01)


def test_paths_grow_and_targets_end_with_the_plan(recorded: dict[str, dict[str, list[Any]]]) -> None:
    camera = known_replay().cameras[0]
    paths = recorded["/world/paths/spiral"]["LineStrips3D:strips"]
    for frame, (strip,) in enumerate(paths):
        np.testing.assert_allclose(strip, cartesian(camera.path[: frame + 1]), rtol=1e-6)
    targets = recorded["/world/targets/spiral"]["Points3D:positions"]
    assert [len(points) for points in targets] == [1] * (FRAMES - 1) + [0]
    np.testing.assert_allclose([points[0] for points in targets[:-1]], cartesian(camera.path[1:]), rtol=1e-6)
    assert [len(points) for points in recorded["/world/targets/no-act"]["Points3D:positions"]] == [0] * FRAMES


def test_a_field_has_a_point_for_every_other_direction(recorded: dict[str, dict[str, list[Any]]]) -> None:
    held = recorded["/world/fields/spiral"]
    cells = np.array(held["Points3D:positions"])
    count = len(map_polars()[::2]) * len(MAP_AZIMUTHS[:-1:2])
    assert cells.shape == (FRAMES, count, 3)
    np.testing.assert_allclose(np.linalg.norm(cells, axis=-1), 8.0, rtol=1e-6)
    gain = known_replay().cameras[0].gain
    assert gain is not None
    colours = np.array(held["Points3D:colors"], dtype=np.uint32)
    for frame, values in enumerate((*gain, gain[-1])):
        shown = values[::2, :-1:2].ravel()
        light = (colours[frame] >> 16) & 0xFF  # the green part of cividis grows
        assert light[shown.argmax()] == light.max() > light[shown.argmin()] == light.min()


def test_beliefs_are_those_that_were_scored(recorded: dict[str, dict[str, list[Any]]]) -> None:
    for camera in known_replay().cameras:
        np.testing.assert_allclose(recorded[f"/belief/{camera.name}"]["Scalars:scalars"], camera.probabilities)
        true = np.ravel(recorded[f"/true/{camera.name}"]["Scalars:scalars"])
        np.testing.assert_allclose(true, camera.probabilities[:, 1])
        right = np.ravel(recorded[f"/right/{camera.name}"]["Scalars:scalars"])
        np.testing.assert_array_equal(right, camera.probabilities.argmax(axis=1) == 1)
        (names,) = recorded[f"/belief/{camera.name}"]["SeriesLines:names"]
        assert tuple(names) == CLASS_NAMES
    (about,) = recorded["/about"]["TextDocument:text"]
    assert "sequence-3 from frame 0" in about[0]


def test_any_name_is_one_entity(tmp_path: Path) -> None:
    name = "il/0 radius=6 ö"
    unseen = camera_replay(name, azimuth=0.0)
    unseen = replace(unseen, seen=np.zeros_like(unseen.seen), target=None)
    write_recording(known_replay(cameras=(unseen,)), tmp_path / "a.rrd")
    found = {piece.entity_path for piece in chunk.RrdReader(tmp_path / "a.rrd").stream()}
    assert [path for path in found if path.startswith("/world/cameras/") and path.endswith("/joints")] == [
        "/world/cameras/il\\/0\\ radius\\=6\\ ö/joints"
    ]


def test_other_endings_are_refused() -> None:
    check_recording(Path("a.rrd"))
    with pytest.raises(UsageError, match=r"^a.mp4: expected a Rerun recording that ends in .rrd$"):
        check_recording(Path("a.mp4"))


def test_a_stream_moves_through_space_and_names_what_is_shown(tmp_path: Path) -> None:
    centres = np.linspace([0.0, 0.0, 0.0], [1.0, 0.2, 0.0], FRAMES)
    labels = np.array([0, 0, 2, 2, 2, 1])
    held = held_by(known_replay(labels=labels, centres=centres), tmp_path / "a.rrd")
    joints = np.array(held["/world/people/1/joints"]["Points3D:positions"])
    np.testing.assert_allclose(joints, known_replay().positions[:, 1] + centres[:, None], rtol=1e-5)
    moved = np.array(held["/world/cameras/no-act"]["Transform3D:translation"]).reshape(-1, 3)
    np.testing.assert_allclose(moved - moved[0], centres, atol=1e-5)  # it stays where it is, seen from the centre
    assert held["/shown"]["frame"] == [1, 3, 6]
    assert [text[0] for text in held["/shown"]["TextDocument:text"]] == [f"# {CLASS_NAMES[at]}" for at in (0, 2, 1)]


def test_what_is_in_the_way_is_recorded(tmp_path: Path) -> None:
    replay = known_replay()
    passers = replay.positions[:, :1] + [3.0, -1.0, 0.0]
    box = Obstacles(boxes=(Box(centre=(2.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)),))
    held = held_by(replace(replay, passers=passers, obstacles=box), tmp_path / "a.rrd")
    strips = np.array(held["/world/passers"]["LineStrips3D:strips"])
    np.testing.assert_allclose(strips, passers[:, 0][:, np.array(SKELETON.bones)], rtol=1e-6)
    assert len(held["/world/obstacles"]["LineStrips3D:strips"][0]) == len(outlines(box))
