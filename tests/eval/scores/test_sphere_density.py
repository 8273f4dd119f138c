import numpy as np

from eval.scores.sphere_density import CELLS, from_above, sphere_density


def test_the_middle_is_above_and_the_rim_is_level() -> None:
    points = from_above(np.array([[9, 1.0, 0.0], [9, 0.0, np.pi / 2], [5, np.pi / 2, np.pi / 2]]))
    np.testing.assert_allclose(points, [[0, 0], [1, 0], [0, 1]], atol=1e-12)


def test_even_directions_give_an_even_disc() -> None:
    rng = np.random.default_rng(0)
    polar = np.arccos(rng.random(400_000))  # even over the upper half of the sphere
    viewpoint = np.stack([np.full(len(polar), 9.0), rng.uniform(0, 2 * np.pi, len(polar)), polar], axis=-1)
    density = sphere_density(viewpoint).times_even
    middle = density[CELLS // 4 : -CELLS // 4, CELLS // 4 : -CELLS // 4]
    np.testing.assert_allclose(middle, 1, atol=0.25)
    assert np.isnan(density[0, 0])


def test_all_frames_are_counted() -> None:
    viewpoint = np.tile([9.0, 0.3, 1.0], (4, 7, 1))
    density = sphere_density(viewpoint)
    even = (2 / CELLS) ** 2 / np.pi * 28
    assert np.nansum(density.times_even) * even == np.float64(28)
    row, column = np.unravel_index(np.nanargmax(density.times_even), density.times_even.shape)
    x, y = from_above(viewpoint)[0, 0]
    assert density.edges[column] <= x <= density.edges[column + 1]
    assert density.edges[row] <= y <= density.edges[row + 1]
