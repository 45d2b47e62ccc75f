"""Images of other programs: their conventions are found, and each wrong pixel is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import atra
from atra.errors import InputError
from atra.judge.conventions import OFFSETS, Convention
from atra.judge.foreign import ForeignImage, judge_image
from atra.prim_ids import MISS
from tests.lenses import lens_camera
from tests.meshes import cornell_box, cornell_camera

WIDTH, HEIGHT = 48, 36


@pytest.fixture(scope="module")
def box() -> tuple[atra.Mesh, atra.Camera]:
    """The Cornell box from a corner: few of its surfaces face the eye, so that each shift changes depths."""
    return cornell_box(), cornell_camera(WIDTH, HEIGHT)


OWN = Convention()


def right_image(mesh: atra.Mesh, camera: atra.Camera, convention: Convention = OWN) -> ForeignImage:
    """What a right program that follows this convention stores."""
    with atra.RasterTracer(mesh, camera) as tracer:
        hits = tracer.trace(convention.offset)
    depth = hits.depth
    if convention.along_ray != camera.depth_is_along_ray:
        y, x = np.mgrid[: camera.height, : camera.width]
        directions = camera.rays(x, y, convention.offset)[1]
        lengths = np.linalg.norm(directions, axis=-1)
        ratios = (lengths if convention.along_ray else directions[..., 2] / lengths)[hits.hit]
        depth = depth.copy()
        depth[hits.hit] = (depth[hits.hit] * ratios).astype(np.float32)
    return ForeignImage(stored(depth, convention), stored(hits.prim_id, convention))


def stored(image: NDArray, convention: Convention) -> NDArray:
    """The inverse of `Convention.ordered`."""
    image = image[:, ::-1] if convention.flips_columns else image
    image = image[::-1] if convention.flips_rows else image
    return np.ascontiguousarray(image.T if convention.swaps_axes else image)


CONVENTIONS = [
    Convention(),
    Convention(flips_rows=True),
    Convention(flips_columns=True),
    Convention(flips_rows=True, flips_columns=True),
    Convention(swaps_axes=True),
    Convention(swaps_axes=True, flips_rows=True, along_ray=True),
    Convention(along_ray=True),
    *(Convention(offset) for offset in OFFSETS),
]


@pytest.mark.parametrize("has_ids", [True, False])
@pytest.mark.parametrize("convention", CONVENTIONS, ids=str)
def test_the_convention_of_a_right_image_is_found_and_nothing_is_wrong(
    convention: Convention, has_ids: bool, box: tuple[atra.Mesh, atra.Camera]
) -> None:
    image = right_image(*box, convention)
    found = judge_image(*box, image if has_ids else ForeignImage(image.depth))
    assert found.convention == convention
    assert found.agreeing > 0.99
    assert found.is_right, list(found.explained())


LENSES = {
    "fisheye": lens_camera(atra.FisheyeLens.of([0.02, 0.003, 0.0, 0.0]), cornell_camera(WIDTH, HEIGHT), WIDTH, HEIGHT),
    "fisheye seeing sideways and behind": lens_camera(
        atra.FisheyeLens.of([0.0] * 4), atra.Camera((0.5, 0.5, 0.4), (0.7, 0.6, 0.1)), WIDTH, HEIGHT, 0.2
    ),
    "panorama": atra.LensCamera.panorama((0.5, 0.5, 0.4), (0.7, 0.6, 0.1), width=WIDTH),
    "perspective lens": lens_camera(atra.OpenCVLens.of([-0.2, 0.05, 0.001, 0.001]), cornell_camera(WIDTH, HEIGHT)),
}


@pytest.mark.parametrize("is_stated", [True, False])
@pytest.mark.parametrize("along_ray", [True, False])
@pytest.mark.parametrize("camera", LENSES.values(), ids=LENSES)
def test_depths_of_a_lens_along_the_ray_or_the_axis_are_right_and_named_so(
    camera: atra.LensCamera, along_ray: bool, is_stated: bool
) -> None:
    truth = Convention(along_ray=along_ray)
    image = right_image(cornell_box(), camera, truth)
    found = judge_image(cornell_box(), camera, image, convention=truth if is_stated else None)
    assert found.convention == truth
    assert str(found.convention).endswith("depth along the ray" if along_ray else "depth along the view axis")
    assert found.agreeing > 0.99
    assert found.is_right, list(found.explained())
    assert image.prim_id is not None
    assert (image.prim_id != MISS).mean() > 0.2


def test_a_lens_that_sees_sideways_has_depth_along_the_ray_as_its_own_convention() -> None:
    own = {name: Convention.own(camera).along_ray for name, camera in LENSES.items()}
    assert [name for name, is_along_ray in own.items() if not is_along_ray] == ["perspective lens"]
    image = right_image(cornell_box(), LENSES["panorama"], Convention(along_ray=True))
    depth = image.depth * np.float32(1.001)
    found = judge_image(cornell_box(), LENSES["panorama"], ForeignImage(depth, image.prim_id))
    assert found.agreement.pixels_wrong > 0.9 * depth.size
    noise = ForeignImage(np.random.default_rng(0).uniform(1, 9, depth.shape))
    assert judge_image(cornell_box(), LENSES["panorama"], noise).convention == Convention(along_ray=True)


def test_the_ids_decide_which_way_a_ball_is_shown_when_depths_fit_both_ways() -> None:
    ball = trimesh.creation.icosphere(3)
    mesh, camera = atra.Mesh(ball.vertices, ball.faces), atra.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 50.0, 64, 64)
    for offset in OFFSETS:
        image = right_image(mesh, camera, Convention(offset))
        with_ids, without = judge_image(mesh, camera, image), judge_image(mesh, camera, ForeignImage(image.depth))
        assert with_ids.convention == without.convention == Convention(offset)
        assert with_ids.is_right
        assert without.is_right
    turned = Convention(flips_rows=True, flips_columns=True)
    found = judge_image(mesh, camera, right_image(mesh, camera, turned))
    assert found.convention == turned
    assert found.is_right


@pytest.mark.parametrize("has_ids", [True, False])
@pytest.mark.parametrize("fault", ["depth", "miss"])
def test_one_wrong_pixel_is_found_and_explained(fault: str, has_ids: bool, box: tuple[atra.Mesh, atra.Camera]) -> None:
    image = right_image(*box)
    assert image.prim_id is not None
    depth, prim_id = image.depth.copy(), image.prim_id.copy()
    y, x = np.argwhere(prim_id != MISS)[200]
    if fault == "depth":
        depth[y, x] *= np.float32(1.001)
    else:
        depth[y, x], prim_id[y, x] = np.inf, MISS
    found = judge_image(*box, ForeignImage(depth, prim_id if has_ids else None))
    assert (found.agreement.pixels_wrong, found.agreement.pixels_hole) == (1, int(fault == "miss"))
    (said,) = found.explained()
    kind, shown = ("hole", "nothing") if fault == "miss" else ("wrong", f"at depth {depth[y, x]:.7g}")
    assert said.startswith(f"({x}, {y}) {kind}: the image shows ")
    assert shown in said.split(", expected ")[0]
    assert f"triangle {image.prim_id[y, x]} at depth" in said.split(", expected ")[1]


def test_depths_in_steps_are_right_within_half_a_step_and_no_farther(box: tuple[atra.Mesh, atra.Camera]) -> None:
    depth, step = right_image(*box).depth, 0.01
    rounded = np.rint(depth / step) * step
    assert judge_image(*box, ForeignImage(rounded, rounding=0.51 * step)).is_right
    assert not judge_image(*box, ForeignImage(rounded, rounding=0.1 * step)).is_right
    rounded[HEIGHT // 2, WIDTH // 2] += 2 * step
    assert judge_image(*box, ForeignImage(rounded, rounding=0.51 * step)).agreement.pixels_wrong == 1


def test_two_images_are_compared_with_each_other(box: tuple[atra.Mesh, atra.Camera]) -> None:
    image, flipped = right_image(*box), right_image(*box, Convention(flips_rows=True))
    assert judge_image(*box, image, against=flipped).is_right
    broken = image.depth.copy()
    broken[5, 5] *= 2
    assert not judge_image(*box, image, against=ForeignImage(broken)).is_right
    with pytest.raises(InputError, match="one image has its rays through pixel centres, the other through the upper"):
        judge_image(*box, image, against=right_image(*box, Convention((0.0, 0.0))))


def test_an_image_that_fits_no_convention_is_judged_in_our_own(box: tuple[atra.Mesh, atra.Camera]) -> None:
    noise = np.random.default_rng(0).uniform(1, 9, (HEIGHT, WIDTH))
    found = judge_image(*box, ForeignImage(noise))
    assert found.convention == Convention()
    assert found.agreement.pixels_wrong > 0.9 * WIDTH * HEIGHT


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (lambda: ForeignImage(np.zeros((2, 3, 4))), r"depth is float64 of shape \(2, 3, 4\)"),
        (lambda: ForeignImage(np.full((2, 3), "far")), "depth is <U3 of shape"),
        (lambda: ForeignImage(np.zeros((2, 3)), np.zeros((3, 2), int)), r"prim_id is int64 of shape \(3, 2\)"),
        (lambda: ForeignImage(np.zeros((2, 3)), rounding=-1.0), "rounding is -1.0, expected a number of at least 0"),
    ],
)
def test_what_is_no_image_is_refused(image: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        image()  # type: ignore[operator]


def test_an_image_of_another_size_is_refused(box: tuple[atra.Mesh, atra.Camera]) -> None:
    with pytest.raises(InputError, match=r"the image is \(7, 9\), expected the camera's \(36, 48\)"):
        judge_image(*box, ForeignImage(np.ones((7, 9))))
