from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from ehar.obstacles import Box, Obstacles
from ehar.viewpoint import cartesian
from eval.render.figures import shortened
from eval.render.outlines import outlines
from eval.render.palette import PAIR
from eval.replays.figure import HEIGHT, WIDTH, ReplayFigure
from eval.replays.panels import Beliefs, CoursePanel, DirectionMap, Image, unbroken
from eval.replays.scene import CLEAR, TILT, DrawnScene, view_from_aside
from tests.helpers.fakes import SKELETON
from tests.helpers.replays import FRAMES, PERSONS, camera_replay, known_replay

BONES = len(SKELETON.bones)


def axes() -> Any:
    return Figure(figsize=(4, 3)).add_subplot()


def test_frames_are_drawn_alike_in_any_order() -> None:
    figure = ReplayFigure(known_replay(), 4.0)
    forth = [figure.draw(frame) for frame in range(FRAMES)]
    back = [figure.draw(frame) for frame in reversed(range(FRAMES))]
    for one, again in zip(forth, reversed(back), strict=True):
        assert one.shape == (HEIGHT, WIDTH, 3)
        np.testing.assert_array_equal(one, again)
    for one, following in pairwise(forth):
        assert 0.001 < (one != following).any(axis=-1).mean() < 0.5


def test_names_are_drawn_as_they_are_and_one_camera_alone() -> None:
    replay = known_replay(class_names=("$x^", "a\nb", "_" * 200), cameras=(camera_replay("$\\frac", azimuth=1.0),))
    assert ReplayFigure(replay, 1.0).draw(FRAMES - 1).std() > 10


def test_long_texts_are_cut_off_on_one_line() -> None:
    assert shortened("two\n words", 9) == "two words"
    assert shortened("two words", 8) == "two wor…"


def way_of(azimuths: Any, polar: float) -> Any:
    return cartesian(np.stack(np.broadcast_arrays(8.0, np.radians(azimuths), polar), axis=-1))


@pytest.mark.parametrize("middle", [0.0, 123.0, 260.0])
def test_the_view_is_from_a_side_where_cameras_are_clear_of_the_people(middle: float) -> None:
    ways = [way_of(middle + np.arange(-40.0, 41.0, 4.0), np.radians(polar)) for polar in (60, 85)]
    view = view_from_aside(ways)
    right, up = view
    np.testing.assert_allclose([right @ right, up @ up, right @ up], [1, 1, 0], atol=1e-12)
    towards_viewer = np.cross(right, up)
    assert towards_viewer[2] == pytest.approx(np.sin(TILT))
    assert right[2] == pytest.approx(0)  # level stays level
    assert up[2] > 0
    drawn = np.concatenate([way @ view.T for way in ways])
    assert np.linalg.norm(drawn, axis=1).min() >= CLEAR * 8


def test_of_clear_views_that_with_the_longest_way_is_taken() -> None:
    right, _ = view_from_aside([way_of(np.arange(-40.0, 41.0, 4.0), np.radians(20))])  # high above: clear on most sides
    assert abs(right[1]) > 0.9  # it goes along y, and so across the picture


def test_the_scene_shows_where_all_are() -> None:
    replay = known_replay()
    scene = DrawnScene(axes(), replay)
    trail, way = scene._cameras[0]._trail, scene._cameras[0]._way
    for frame in (0, FRAMES - 1):
        scene.show(frame)
        assert len(scene._bones.get_segments()) == PERSONS * BONES
        assert len(trail.get_xydata()) == frame + 1
        assert way.get_visible() is (frame < FRAMES - 1)  # the last frame is not planned upon
        assert not scene._cameras[1]._goal.get_visible()  # it wants to be where it is
    low, high = scene._axes.get_xlim()
    reached = np.concatenate([trail.get_xydata(), *scene._bones.get_segments()])
    assert (low < reached[:, 0]).all() and (reached[:, 0] < high).all()


def test_an_image_shows_the_bones_between_joints_that_were_found() -> None:
    camera = known_replay().cameras[0]
    seen = camera.seen.copy()
    seen[2, 1, 0] = False  # the head of the second person, which three bones meet in
    image = Image(axes(), known_replay(), replace(camera, seen=seen))
    image.show(1)
    assert len(image._lines.get_segments()) == PERSONS * BONES
    image.show(2)
    drawn = image._lines.get_segments()
    assert len(drawn) == PERSONS * BONES - 3
    np.testing.assert_allclose(drawn[0], camera.joints_2d[2, 0][list(SKELETON.bones[0])])
    assert len(image._dots.get_offsets()) == seen[2].sum() == seen[1].sum() - 1


def test_nothing_seen_is_an_empty_image() -> None:
    camera = known_replay().cameras[0]
    image = Image(axes(), known_replay(), replace(camera, seen=np.zeros_like(camera.seen)))
    image.show(0)
    assert not image._lines.get_segments()


def test_bars_are_as_long_as_probabilities() -> None:
    replay = known_replay()
    beliefs = Beliefs(axes(), replay, replay.cameras[0], PAIR[0])
    beliefs.show(4)
    widths = np.array([bar.get_width() for bar in beliefs._bars])
    expected = replay.cameras[0].probabilities[4, replay.shown_classes]
    np.testing.assert_allclose(widths / widths.sum(), expected)
    most = replay.class_names[int(replay.cameras[0].probabilities[4].argmax())]
    assert beliefs._said.get_text().startswith(f"recognised: {most}, ")
    colours = [bar.get_facecolor() for bar in beliefs._bars]
    assert colours[0] == to_rgba(PAIR[0].colour) and to_rgba(PAIR[0].colour) not in colours[1:]


def test_the_true_class_comes_first_and_the_most_believed_follow() -> None:
    believed = np.tile(np.linspace(0, 1, 20) / 10, (FRAMES, 1))
    cameras = (camera_replay("one", azimuth=0.0, probabilities=believed),)
    replay = known_replay(class_names=tuple(map(str, range(20))), labels=np.full(FRAMES, 2), cameras=cameras)
    assert replay.shown_classes == [2, 15, 16, 17, 18, 19]
    assert known_replay().shown_classes == [1, 0, 2]


def test_a_course_ends_at_the_frame_and_shows_where_it_was_right() -> None:
    replay = known_replay()
    course = CoursePanel(axes(), replay)
    course.show(3)
    for camera, line, (strip, _), look in zip(replay.cameras, course._lines, course._rights, PAIR, strict=True):
        np.testing.assert_allclose(line.get_ydata(), 100 * camera.probabilities[:4, 1])
        pixels = strip.get_array()
        right = camera.probabilities.argmax(axis=1) == 1
        assert (pixels[0, :, 3] > 0).tolist() == [True] * 4 + [False] * 2
        coloured = [pixels[0, frame].tolist() == pytest.approx(to_rgba(look.colour)) for frame in range(4)]
        assert coloured == right[:4].tolist()


def test_a_path_on_the_map_has_a_gap_where_it_leaves_it() -> None:
    degrees = np.array([350.0, 355.0, 0.0, 5.0, 0.0, 355.0])
    path = np.column_stack([np.full(6, 8.0), np.radians(degrees), np.radians(np.arange(6.0))])
    azimuth, polar, ends = unbroken(path)
    np.testing.assert_allclose(azimuth, [350, 355, np.nan, 0, 5, 0, np.nan, 355], atol=1e-9)
    np.testing.assert_allclose(azimuth[ends], degrees, atol=1e-9)
    np.testing.assert_allclose(polar[ends], np.arange(6.0), atol=1e-9)


def test_the_map_shows_the_field_of_the_frame() -> None:
    camera = known_replay().cameras[0]
    shown = DirectionMap(axes(), camera, PAIR[0])
    assert shown._field is not None and camera.gain is not None
    for frame, of_field in ((2, 2), (FRAMES - 1, FRAMES - 2)):  # of the last frame there is none
        shown.show(frame)
        np.testing.assert_array_equal(shown._field.get_array(), camera.gain[of_field])
        assert shown._field.get_clim() == (camera.gain[of_field].min(), camera.gain[of_field].max())
        low, high = camera.gain[of_field].min(), camera.gain[of_field].max()
        assert shown._caption.get_text() == f"gain field: {low:+.1f} (dark) to {high:+.1f} % (light)"
    alone = DirectionMap(axes(), known_replay().cameras[1], PAIR[1])
    alone.show(0)
    assert alone._caption.get_text() == "all directions; it has no gain field"


def test_passers_by_are_drawn_where_they_are_as_large_as_people() -> None:
    replay = known_replay()
    passers = replay.positions[:, :1] + [3.0, -1.0, 0.0]
    scene = DrawnScene(axes(), replace(replay, passers=passers))
    scene.show(2)
    drawn = np.array([line.tolist() for line in scene._passing.get_segments()])
    plane, bones = scene._to_plane, np.array(SKELETON.bones)
    place = passers[2, 0].mean(axis=0) * [1, 1, 0]
    np.testing.assert_allclose(drawn, ((place + scene.enlarged * (passers[2, 0] - place)) @ plane.T)[bones])
    lengths = np.linalg.norm(drawn[:, 0] - drawn[:, 1], axis=-1)
    people = np.array([line.tolist() for line in scene._bones.get_segments()])[:BONES]
    np.testing.assert_allclose(lengths, np.linalg.norm(people[:, 0] - people[:, 1], axis=-1))


def test_what_stands_stays_where_it_is_when_the_centre_of_a_stream_moves() -> None:
    centres = np.linspace([0, 0, 0], [1.0, 2.0, 0.0], FRAMES)
    box = Obstacles(boxes=(Box(centre=(2.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)),))
    scene = DrawnScene(axes(), known_replay(centres=centres, obstacles=box))
    for frame in (0, FRAMES - 1):
        scene.show(frame)
        for drawn, line in zip(scene._obstacles.get_segments(), outlines(box), strict=True):
            np.testing.assert_allclose(drawn, (line - centres[frame]) @ scene._to_plane.T, atol=1e-9)
