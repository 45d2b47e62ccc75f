"""The metallic-roughness material: energy, reciprocity, and densities against histograms of what is chosen."""

import numpy as np
import pytest

from atra import light
from atra.compiled.store import float_kernel
from atra.light.scattering.lost_kernels import lost, lost_mean
from atra.light.scattering.physical_kernels import clear_light, physical_direction, physical_value
from atra.light.scattering.spots_kernels import Matter

F = np.float32


@float_kernel
def chosen(matter, out, numbers, directions, weights, densities):
    for k in range(len(numbers)):
        way, weight, density = physical_direction(
            matter, (out[0], out[1], out[2]), numbers[k, 0], numbers[k, 1], numbers[k, 2]
        )
        for axis in range(3):
            directions[k, axis], weights[k, axis] = way[axis], weight[axis]
        densities[k] = density


@float_kernel
def valued(matter, outs, ways, values, densities):
    for k in range(len(ways)):
        value, density = physical_value(
            matter, (outs[k, 0], outs[k, 1], outs[k, 2]), (ways[k, 0], ways[k, 1], ways[k, 2])
        )
        for axis in range(3):
            values[k, axis] = value[axis]
        densities[k] = density


def matter(metallic=0.0, roughness=0.5, transmission=0.0, ior=1.5, is_thin=True, colour=(1.0, 1.0, 1.0)):
    return Matter(tuple(F(c) for c in colour), F(metallic), F(roughness**2), F(transmission), F(ior), is_thin)


def sampled(made, cosine, count=1 << 16):
    """(directions, weights, densities) of `count` random choices."""
    out = np.array([np.sqrt(1 - cosine**2), 0.0, cosine], F)
    numbers = np.random.default_rng(1).random((count, 3)).astype(F) * F(1 - 1e-6)
    directions, weights, densities = np.zeros((count, 3), F), np.zeros((count, 3), F), np.zeros(count, F)
    chosen(made, out, numbers, directions, weights, densities)
    return directions, weights, densities


def values_of(made, outs, ways):
    """(values, densities) for pairs of directions."""
    values, densities = np.zeros((len(ways), 3), F), np.zeros(len(ways), F)
    valued(made, np.ascontiguousarray(outs, F), np.ascontiguousarray(ways, F), values, densities)
    return values, densities


def grid(rows, columns):
    """Directions to the middles of equal cells of the sphere, (rows, columns, 3)."""
    height = 1.0 - (np.arange(rows) + 0.5) * 2.0 / rows
    turn = (np.arange(columns) + 0.5) * 2.0 * np.pi / columns
    across = np.sqrt(1.0 - height**2)
    return np.stack(
        np.broadcast_arrays(across[:, None] * np.cos(turn), across[:, None] * np.sin(turn), height[:, None]), -1
    )


WHITE = {
    "rough metal": matter(1.0, 0.6),
    "smooth metal": matter(1.0, 0.0),
    "clear glass": matter(0.0, 0.0, 1.0, is_thin=False),
    "clear glass from within": matter(0.0, 0.0, 1.0, 1 / 1.5, False),
    "rough glass": matter(0.0, 0.5, 1.0, is_thin=False),
    "rough glass from within": matter(0.0, 0.5, 1.0, 1 / 1.5, False),
    "a rough thin pane": matter(0.0, 0.5, 1.0),
    "a clear thin pane": matter(0.0, 0.0, 1.0),
}


@pytest.mark.parametrize("cosine", [0.15, 0.6, 1.0])
@pytest.mark.parametrize("name", WHITE)
def test_in_a_furnace_nothing_white_shines_and_what_is_smooth_keeps_all(name, cosine):
    _, weights, _ = sampled(WHITE[name], cosine)
    mean = weights[:, 0].mean()
    if name == "a clear thin pane":  # what passes straight on is not scattered
        straight = clear_light(WHITE[name], F(cosine))[0]
        assert straight == pytest.approx(0.96 * (1 - (1 - cosine) ** 5), abs=1e-4)
        mean += straight
    if "rough" in name and "metal" not in name:  # light that meets a second microfacet is lost behind glass
        assert 0.75 < mean < 1.005
    elif "rough" in name:
        assert mean == pytest.approx(1.0, abs=0.01)
    else:
        assert mean == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("ior", [1.0, 1.0005, 1 / 1.0005])
@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_rough_glass_that_bends_no_light_lets_all_of_it_straight_on(ior, roughness):
    made = matter(0.0, roughness, 1.0, ior, False)
    directions, weights, densities = sampled(made, 0.6)
    np.testing.assert_allclose(directions, np.broadcast_to([-0.8, 0, -0.6], directions.shape), atol=1e-6)
    np.testing.assert_allclose(weights, 1.0, atol=1e-6)
    assert not densities.any()
    assert clear_light(made, F(0.6))[0] == pytest.approx(1.0, abs=1e-5)
    assert light.MetallicRoughness(roughness=roughness, transmission=1.0, ior=1.0, is_thin=False).clear_share == 1.0


@pytest.mark.parametrize("ior", [1.002, 1 / 1.002])
def test_rough_glass_that_hardly_bends_light_lets_nearly_all_of_it_on(ior):
    assert sampled(matter(0.0, 0.3, 1.0, ior, False), 0.6)[1][:, 0].mean() == pytest.approx(1.0, abs=0.01)


def test_metal_keeps_its_roughness_where_its_index_bends_no_light():
    made, usual = (matter(1.0, 0.5, 1.0, ior, False, (0.8, 0.4, 0.2)) for ior in (1.0, 1.5))
    for found, expected in zip(sampled(made, 0.6), sampled(usual, 0.6), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def reflected_once(roughness, cosine, count=512):
    """The share of light that white microfacets reflect once: the integral over their normals, by quadrature."""
    alpha = roughness**2
    u, turn = np.meshgrid((np.arange(count) + 0.5) / count, (np.arange(count) + 0.5) / count * 2 * np.pi)
    up = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))  # of normals, as often as their projected area
    across = np.sqrt(1 - up**2)
    out = np.sqrt(1 - cosine**2), cosine
    facing = np.maximum(out[0] * across * np.cos(turn) + out[1] * up, 0.0)
    onward = 2 * facing * up - cosine
    rise = lambda c: np.sqrt(alpha**2 + (1 - alpha**2) * c**2)  # noqa: E731
    seen = np.maximum(onward, 1e-9)
    masking = 2 * cosine * seen / (seen * rise(cosine) + cosine * rise(seen))
    return float(np.where(onward > 0, masking * facing / (cosine * up), 0.0).mean())


@float_kernel
def lost_shares(alphas, cosines, shares, means):
    for k in range(len(alphas)):
        shares[k], means[k] = lost(alphas[k], cosines[k]), lost_mean(alphas[k])


def test_the_share_that_is_lost_at_one_reflection_is_the_integral_of_the_model():
    cosines = (np.arange(32) + 0.5) / 32
    for roughness in (0.1, 0.25, 0.4, 0.6, 0.8, 1.0):
        shares, means = np.zeros((2, len(cosines)), F)
        lost_shares(np.full(len(cosines), roughness**2, F), cosines.astype(F), shares, means)
        expected = np.array([1 - reflected_once(roughness, cosine) for cosine in cosines])
        np.testing.assert_allclose(shares[1:], expected[1:], atol=0.01)  # the quadrature is coarse where it is grazing
        np.testing.assert_allclose(means[0], (2 * cosines * expected).mean(), atol=0.005)


@pytest.mark.parametrize("cosine", [0.05, 0.15, 0.6, 1.0])
@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0])
def test_white_metal_of_any_roughness_keeps_all_light_of_a_furnace(roughness, cosine):
    ways = grid(1024, 1024).reshape(-1, 3)[: 1024 * 512] if roughness >= 0.35 else None
    made = matter(1.0, roughness)
    _, weights, _ = sampled(made, cosine)
    assert 0.98 < weights[:, 0].mean() < 1.01
    if ways is not None:
        values, _ = values_of(made, np.broadcast_to([np.sqrt(1 - cosine**2), 0, cosine], ways.shape), ways)
        assert 0.98 < values[:, 0].astype(float).mean() * 2 * np.pi < 1.01


@pytest.mark.parametrize("roughness", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("ior", [1.0, 1.5, 2.4])
def test_white_plastic_of_any_roughness_keeps_all_light_from_above(roughness, ior):
    for cosine in (0.6, 1.0):
        assert sampled(matter(0.0, roughness, 0.0, ior), cosine)[1][:, 0].mean() == pytest.approx(0.995, abs=0.02)


def test_rough_gold_is_deeper_in_colour_than_smooth_gold():
    smooth, rough = (sampled(matter(1.0, one, colour=(1.0, 0.6, 0.2)), 1.0)[1].mean(0) for one in (0.1, 1.0))
    assert rough[2] / rough[0] < 0.9 * smooth[2] / smooth[0]


MIXED = {
    "plastic": matter(0.0, 0.4, colour=(0.8, 0.4, 0.2)),
    "half metal": matter(0.5, 0.3, colour=(0.8, 0.4, 0.2)),
    "metal": matter(1.0, 0.5, colour=(0.8, 0.4, 0.2)),
    "half pane": matter(0.2, 0.5, 0.5, colour=(0.8, 0.9, 0.7)),
    "glass": matter(0.0, 0.6, 1.0, is_thin=False),
    "glass from within": matter(0.0, 0.6, 1.0, 1 / 1.5, False),
}


@pytest.mark.parametrize("name", MIXED)
def test_the_density_of_directions_is_their_histogram(name):
    rows, columns, fine = 8, 8, 32
    directions, _, densities = sampled(MIXED[name], 0.7, 1 << 17)
    good = densities > 0
    x, y, z = directions[good].T
    row = np.clip(((1 - z) / 2 * rows).astype(int), 0, rows - 1)
    column = ((np.arctan2(y, x) % (2 * np.pi)) / (2 * np.pi) * columns).astype(int) % columns
    found = np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns) / len(densities)
    ways = grid(rows * fine, columns * fine).reshape(-1, 3)
    out = np.broadcast_to([np.sqrt(1 - 0.49), 0, 0.7], ways.shape)
    _, density = values_of(MIXED[name], out, ways)
    cells = density.astype(float).reshape(rows, fine, columns, fine).mean((1, 3)) * 4 * np.pi / (rows * columns)
    np.testing.assert_allclose(found, cells, atol=5 * np.sqrt(cells.max() / len(densities)), rtol=0.03)
    assert found.sum() > 0.6


@pytest.mark.parametrize("name", MIXED)
def test_weights_of_chosen_directions_add_up_to_the_integral_of_what_is_scattered(name):
    _, weights, _ = sampled(MIXED[name], 0.7, 1 << 17)
    ways = grid(256, 512).reshape(-1, 3)
    values, _ = values_of(MIXED[name], np.broadcast_to([np.sqrt(1 - 0.49), 0, 0.7], ways.shape), ways)
    np.testing.assert_allclose(weights.astype(float).mean(0), values.astype(float).mean(0) * 4 * np.pi, rtol=0.02)


@pytest.mark.parametrize("name", ["plastic", "half metal", "metal", "half pane"])
def test_light_takes_each_way_in_both_directions_alike(name):
    rng = np.random.default_rng(3)
    there, back = rng.normal(size=(2, 400, 3))
    there[:, 2], back[:, 2] = np.abs(there[:, 2]) + 0.05, np.abs(back[:, 2]) + 0.05
    there, back = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (there, back))
    for side in (1.0, -1.0):  # reflected, and through a pane
        flipped = np.array([1.0, 1.0, side])
        one, _ = values_of(MIXED[name], there, back * flipped)
        other, _ = values_of(MIXED[name], back, there * flipped)
        np.testing.assert_allclose(one / back[:, 2:], other / there[:, 2:], rtol=2e-3, atol=1e-6)
