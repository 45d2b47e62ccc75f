"""The metallic-roughness material: energy, reciprocity, and densities against histograms of what is chosen."""

from itertools import product

import numpy as np
import pytest

from atra import light
from atra.compiled.store import float_kernel
from atra.light.scattering.coat_kernels import coated_clear_light, coated_direction, coated_value
from atra.light.scattering.lost_kernels import lost, lost_mean, risen, risen_mean
from atra.light.scattering.seen_kernels import seen_from
from atra.light.scattering.spots_kernels import Matter

F = np.float32


@float_kernel
def chosen(matter, out, numbers, directions, weights, densities):
    for k in range(len(numbers)):
        way, weight, density = coated_direction(
            matter, seen_from(matter, (out[0], out[1], out[2])), numbers[k, 0], numbers[k, 1], numbers[k, 2]
        )
        for axis in range(3):
            directions[k, axis], weights[k, axis] = way[axis], weight[axis]
        densities[k] = density


@float_kernel
def valued(matter, outs, ways, values, densities):
    for k in range(len(ways)):
        value, density = coated_value(
            matter, seen_from(matter, (outs[k, 0], outs[k, 1], outs[k, 2])), (ways[k, 0], ways[k, 1], ways[k, 2])
        )
        for axis in range(3):
            values[k, axis] = value[axis]
        densities[k] = density


def matter(
    metallic=0.0, roughness=0.5, transmission=0.0, ior=1.5, is_thin=True, colour=(1.0, 1.0, 1.0), specular=1.0,
    tint=(1.0, 1.0, 1.0), coat=0.0, coat_roughness=0.3,
):  # fmt: skip
    least = tuple(F(specular * min(1.0, one * ((ior - 1) / (ior + 1)) ** 2)) for one in tint)
    coating = least, F(specular), F(coat), F(coat_roughness**2)
    colour = tuple(F(c) for c in colour)
    return Matter(colour, F(metallic), F(roughness**2), F(transmission), F(ior), is_thin, *coating)


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


FURNACE = {
    "metal": {"metallic": 1.0}, "plastic": {}, "pane": {"transmission": 1.0},
    "glass": {"transmission": 1.0, "is_thin": False}, "half metal, half pane": {"metallic": 0.5, "transmission": 0.5},
    "half solid glass": {"transmission": 0.5, "is_thin": False},
    "tinted plastic": {"specular": 0.6, "tint": (3.0, 1.0, 0.2)},
}  # fmt: skip


def assert_keeps(least, made, cosine):
    """Nearly all white light from there is scattered or goes straight on, and none is added."""
    weights = sampled(made, cosine, 1 << 14)[1][:, 0].astype(float)
    straight = coated_clear_light(made, F(cosine))[0] if made.alpha < 1e-3 and made.is_thin else 0.0
    noise = 4 * weights.std() / np.sqrt(len(weights))
    assert least - noise < weights.mean() + straight < 1.0 + noise + 1e-6, (made, cosine)


@pytest.mark.parametrize("ior", [1.0, 1.2, 1.5, 2.4])
@pytest.mark.parametrize("name", FURNACE)
def test_in_a_furnace_everything_white_of_any_roughness_keeps_all_light_and_adds_none(name, ior):
    iors = (ior, 1 / ior) if "glass" in name else (ior,)  # from outside and from within
    for roughness, cosine, one in product((0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0), (0.05, 0.15, 0.3, 0.6, 1.0), iors):
        assert_keeps(0.98, matter(roughness=roughness, ior=one, **FURNACE[name]), cosine)


@pytest.mark.parametrize("coat_roughness", [0.0, 0.1, 0.3, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("name", FURNACE)
def test_in_a_furnace_a_coat_over_what_is_white_keeps_nearly_all_light_and_adds_none(name, coat_roughness):
    least = 0.97 if name in ("metal", "plastic") else 0.9
    for coat, roughness, cosine in product((0.3, 1.0), (0.0, 0.1, 0.2, 0.4, 0.7, 1.0), (0.05, 0.15, 0.3, 0.6, 1.0)):
        made = matter(roughness=roughness, coat=coat, coat_roughness=coat_roughness, **FURNACE[name])
        assert_keeps(least, made, cosine)


@pytest.mark.parametrize("ior", [1.0, 1.0005, 1 / 1.0005])
@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_rough_glass_that_bends_no_light_lets_all_of_it_straight_on(ior, roughness):
    made = matter(0.0, roughness, 1.0, ior, False)
    directions, weights, densities = sampled(made, 0.6)
    np.testing.assert_allclose(directions, np.broadcast_to([-0.8, 0, -0.6], directions.shape), atol=1e-6)
    np.testing.assert_allclose(weights, 1.0, atol=1e-6)
    assert not densities.any()
    assert coated_clear_light(made, F(0.6))[0] == pytest.approx(1.0, abs=1e-5)
    assert light.MetallicRoughness(roughness=roughness, transmission=1.0, ior=1.0, is_thin=False).clear_share == 1.0


@pytest.mark.parametrize("ior", [1.002, 1 / 1.002])
def test_rough_glass_that_hardly_bends_light_lets_nearly_all_of_it_on(ior):
    assert sampled(matter(0.0, 0.3, 1.0, ior, False), 0.6)[1][:, 0].mean() == pytest.approx(1.0, abs=0.01)


def test_metal_keeps_its_roughness_where_its_index_bends_no_light():
    made, usual = (matter(1.0, 0.5, 1.0, ior, False, (0.8, 0.4, 0.2)) for ior in (1.0, 1.5))
    for found, expected in zip(sampled(made, 0.6), sampled(usual, 0.6), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def reflected_once(roughness, cosine, count=512):
    """The shares of light that white microfacets reflect once, and those that reflect `schlick`, by quadrature."""
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
    once = np.where(onward > 0, masking * facing / (cosine * up), 0.0)
    return once.mean(), (once * (1 - np.minimum(facing, 1)) ** 5).mean()


@float_kernel
def fitted(alphas, cosines, shares):
    for k in range(len(alphas)):
        shares[0, k], shares[1, k] = lost(alphas[k], cosines[k]), lost_mean(alphas[k])
        shares[2, k], shares[3, k] = risen(alphas[k], cosines[k]), risen_mean(alphas[k])


def test_polynomials_are_the_integrals_of_the_model_and_add_no_light():
    cosines = (np.arange(32) + 0.5) / 32
    for roughness in (0.1, 0.25, 0.4, 0.6, 0.8, 1.0):
        shares = np.zeros((4, len(cosines)), F)
        fitted(np.full(len(cosines), roughness**2, F), cosines.astype(F), shares)
        white, rising = np.array([reflected_once(roughness, cosine) for cosine in cosines]).T
        for less, share, mean in (
            (1 - white - shares[0], 1 - white, shares[1]),
            (shares[2] - rising, rising, shares[3]),
        ):
            assert less[1:].min() > -0.001  # the quadrature is coarse where it is grazing
            assert less[1:].max() < 0.0135
            np.testing.assert_allclose(mean[0], (2 * cosines * share).mean(), atol=0.008)


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
    "coated plastic": matter(0.0, 0.6, colour=(0.8, 0.4, 0.2), coat=1.0, specular=0.7, tint=(1.0, 0.5, 0.0)),
    "coated metal": matter(1.0, 0.4, colour=(0.8, 0.4, 0.2), coat=1.0, coat_roughness=0.1),
    "coated glass": matter(0.0, 0.6, 1.0, is_thin=False, coat=0.5, coat_roughness=0.5),
} | {f"white {name}": matter(roughness=0.6, **given) for name, given in FURNACE.items()}


@pytest.mark.parametrize("name", MIXED)
def test_directions_are_chosen_by_their_density_and_their_weights_add_up_to_what_is_scattered(name):
    rows, columns, fine = 8, 8, 32
    directions, weights, densities = sampled(MIXED[name], 0.7, 1 << 17)
    x, y, z = directions[densities > 0].T
    row = np.clip(((1 - z) / 2 * rows).astype(int), 0, rows - 1)
    column = ((np.arctan2(y, x) % (2 * np.pi)) / (2 * np.pi) * columns).astype(int) % columns
    found = np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns) / len(densities)
    ways = grid(rows * fine, columns * fine).reshape(-1, 3)
    values, density = values_of(MIXED[name], np.broadcast_to([np.sqrt(1 - 0.49), 0, 0.7], ways.shape), ways)
    cells = density.astype(float).reshape(rows, fine, columns, fine).mean((1, 3)) * 4 * np.pi / (rows * columns)
    np.testing.assert_allclose(found, cells, atol=5 * np.sqrt(cells.max() / len(densities)), rtol=0.03)
    assert found.sum() > 0.6
    chosen_light = (weights * (densities > 0)[:, None]).astype(float).mean(0)
    np.testing.assert_allclose(chosen_light, values.astype(float).mean(0) * 4 * np.pi, rtol=0.02)


OPAQUE = ["plastic", "half metal", "metal", "half pane", "coated plastic", "coated metal"]
BOTH_WAYS = [(MIXED[name], MIXED[name], 1.0, 1.0) for name in OPAQUE] + [
    (MIXED["half pane"], MIXED["half pane"], -1.0, 1.0),
    *((matter(0.0, 0.7, 1.0, ior, False), matter(0.0, 0.7, 1.0, 1 / ior, False), -1.0, ior) for ior in (1.1, 1.5, 2.4)),
]
"""A material from the one side and from the other, the side where light leaves, and the index by which it spreads."""


@pytest.mark.parametrize(("here", "beyond", "side", "ior"), BOTH_WAYS)
def test_light_takes_each_way_in_both_directions_alike_but_for_its_spread(here, beyond, side, ior):
    there, back = np.random.default_rng(3).normal(size=(2, 2000, 3))
    there[:, 2], back[:, 2] = np.abs(there[:, 2]) + 0.05, np.abs(back[:, 2]) + 0.05
    there, back = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (there, back))
    one, other = values_of(here, there, back * (1, 1, side))[0], values_of(beyond, back, there * (1, 1, side))[0]
    assert (one > 1e-4).any(axis=1).sum() > 50
    np.testing.assert_allclose(one / back[:, 2:], other * ior**2 / there[:, 2:], rtol=5e-3, atol=1e-5)
