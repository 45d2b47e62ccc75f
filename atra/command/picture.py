"""`atra render MESH -o picture.png`: a picture in full light, by path tracing."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from atra.errors import InputError, printable
from atra.files.reading import MEMORY_PER_BYTE, VARIABLE
from atra.geometry.mesh import Mesh
from atra.geometry.view import View

if TYPE_CHECKING:  # a wing of the library, loaded where a picture is asked for
    from atra.light import Progress, Scene
    from atra.light.lights import Light
    from atra.light.pictures.renderer import Renderer

SAMPLES, BOUNCES = 64, 7
"""Defaults: samples without another limit, and most rays of a path."""

CamerasOf = Callable[[Mesh, Mapping[str, View]], dict[str, View]]

_LIMITS = ("samples", "error", "minutes")

_BLACK = np.zeros((1, 1, 3))

_HIDES = 100.0
"""Ratio of the irradiances of two lights from which a hint names them."""


def add_picture(parser: ArgumentParser) -> None:
    """Add the arguments of `run_picture`."""
    group = parser.add_argument_group("pictures in full light, in place of planes")
    group.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help=".png or .exr (default: MESH_picture.png)",
    )
    group.add_argument("--samples", type=int, help=f"most samples of each pixel (default: {SAMPLES})")
    group.add_argument("--error", type=float, metavar="PERCENT", help="stop at this estimated error of the luminance")
    group.add_argument("--minutes", type=float, help="stop after so many minutes")
    group.add_argument(
        "--exposure", default="auto", metavar="STOPS", help="PNG exposure in stops, or auto (the default)"
    )
    add_shown(group)
    group.add_argument("--transparent", action="store_true", help="alpha in place of the sky that the eye sees")
    group.add_argument(
        "--aperture", type=float, metavar="RADIUS", help="blur, by a lens of this radius, what is not in focus"
    )
    group.add_argument("--focus", type=float, metavar="DISTANCE", help="where all is sharp, for --aperture")
    group.add_argument("--bounces", type=int, default=BOUNCES, help=f"most reflections (default: {BOUNCES})")
    add_clamp(group)


def add_clamp(parser: Any) -> None:
    """Add the limit of bright specks."""
    parser.add_argument(
        "--clamp", type=float, metavar="LIGHT", help="most that a path of several reflections adds; biased"
    )


def add_shown(parser: Any) -> None:
    """Add the options of everything that is shown in full light: tone map, denoising, and a sky of a file."""
    parser.add_argument(
        "--tone", default="neutral", choices=("none", "neutral", "agx"), help="tone map of a PNG (default: neutral)"
    )
    parser.add_argument("--denoise", action="store_true", help="remove noise (extra denoise)")
    parser.add_argument(
        "--sky", metavar="SKY",
        help="neutral, none, or an EXR or HDR panorama (default: none beside lights in the file, else neutral)",
    )  # fmt: skip
    parser.add_argument(
        "--sky-rotation", type=float, default=0.0, metavar="DEG",
        help="turn the panorama counterclockwise, from above",
    )  # fmt: skip


def add_scene(parser: ArgumentParser) -> None:
    """Add the file of a scene, and one camera of it."""
    parser.add_argument("mesh", type=Path, help="a file of a mesh; glTF and OBJ keep their materials and lights")
    parser.add_argument(
        "--camera", metavar="CAMERA",
        help="front, back, left, right, top or bottom; a camera's name in the file; or a JSON file of one camera "
        "(default: the file's first, or one that frames the mesh)",
    )  # fmt: skip


def add_limits(parser: ArgumentParser) -> None:
    """Add bounds on threads and memory."""
    parser.add_argument("--threads", type=int, help="number of threads (default: every core)")
    parser.add_argument(
        "--memory-per-byte", type=float, metavar="N",
        help=f"most bytes of memory a byte of a file may take (default: {VARIABLE} or {MEMORY_PER_BYTE:g})",
    )  # fmt: skip


def wants_picture(given: Namespace) -> bool:
    """Whether a picture is asked for. Raises InputError where planes are, too."""
    asked = [f"--{name}" for name in ("output", *_LIMITS) if getattr(given, name) is not None]
    if asked and given.planes is not None:
        raise InputError(f"{asked[0]} makes a picture and --planes makes planes; give one of them")
    return bool(asked)


def load_lit(
    path: Path, sky: str | None = None, memory_per_byte: float | None = None, sky_rotation: float = 0.0
) -> Scene:
    """The scene of a file, as `load_scene` lights it. A hint tells of lights that hardly show beside others.

    sky: neutral, none, or the file of a panorama, in place of that. sky_rotation: degrees of a panorama. Raises
    InputError as `load_scene` and `PanoramaSky.load` do, and for a rotation without a panorama.
    """
    from atra.light import PanoramaSky, constant_sky, load_scene
    from atra.light.sky import NEUTRAL

    others: dict[str, Any] = {}
    plain = {"neutral": NEUTRAL, "none": constant_sky(0.0)}
    if sky is not None:
        others["sky"] = plain.get(sky) or PanoramaSky.load(sky, rotation_degrees=sky_rotation)
    if sky_rotation and (sky is None or sky in plain):
        raise InputError(f"--sky-rotation is {sky_rotation:g} without a panorama, expected the file of one as --sky")
    scene = load_scene(path, memory_per_byte=memory_per_byte, **others)
    size = float(np.linalg.norm(np.ptp(scene.mesh.bounds, axis=0)))
    powers = {k: power for k, light in enumerate(scene.lights) if (power := _on_scene(light, size)) > 0.0}
    if powers:
        most, least = max(powers, key=powers.__getitem__), min(powers, key=powers.__getitem__)
        times = powers[most] / powers[least]
        if times > _HIDES:
            one, other = (f"light {k} ({type(scene.lights[k]).__name__})" for k in (most, least))
            print(
                f"hint: {one} is {times:,.0f} times as bright as {other}, which hardly shows beside it", file=sys.stderr
            )
    return scene


def _on_scene(light: Light, size: float) -> float:
    """The largest irradiance by a light, in the distance of the scene's size if it is a lamp; 0 of an area."""
    power = float(getattr(light, "power", 0.0)) * max(getattr(light, "colour", (0.0,)))
    return power if hasattr(light, "angle_degrees") else power / max(size * size, 1e-30)


def load_with_cameras(given: Namespace) -> tuple[Mesh, dict[str, View]]:
    """The mesh and the cameras of a file. Raises InputError as `load_scene`."""
    from atra.light import load_scene

    scene = load_scene(given.mesh, memory_per_byte=given.memory_per_byte)
    return scene.mesh, dict(scene.cameras)


def run_picture(given: Namespace, cameras_of: CamerasOf) -> int:
    """Make a picture of each camera, resuming what was interrupted; returns 0.

    cameras_of: the cameras for a mesh and those of its file. Raises InputError, before any work, for what no picture
    can be made of; MemoryBudgetError, StorageError.
    """
    from atra.light import PathRenderer, stops_of
    from atra.light.oidn import check_denoiser
    from atra.light.pictures.files import check_picture_path

    output = given.output or Path(f"{given.mesh.stem}_picture.png")  # MESH.png may be a texture of the model
    check_picture_path(output)
    stops_of(_BLACK, given.exposure)
    blur = _blur(given)
    if given.denoise:
        check_denoiser()  # now rather than after all samples
    scene = load_lit(given.mesh, given.sky, given.memory_per_byte, given.sky_rotation)
    cameras = cameras_of(scene.mesh, dict(scene.cameras))
    print(f"{printable(str(given.mesh))}: {scene.mesh.triangle_count:,} triangles", file=sys.stderr)
    for stem, camera in cameras.items():
        path = output if len(cameras) == 1 else output.with_name(f"{output.stem}_{stem}{output.suffix}")
        options = {
            "bounces": given.bounces,
            "threads": given.threads,
            "transparent": given.transparent,
            "clamp": given.clamp,
        }
        with PathRenderer(scene, camera, jitter="pixel", **options, **blur) as renderer:
            _expose(renderer, given, path)
            stops = renderer.save(path, exposure=given.exposure, tone=given.tone, denoise=given.denoise)
        print(say_written(path, stops), flush=True)
    return 0


def _blur(given: Namespace) -> dict[str, Any]:
    """Options of an aperture. Raises InputError for one of both alone."""
    if (given.aperture is None) != (given.focus is None):
        raise InputError("--aperture and --focus belong together: the radius of the lens, and the distance in focus")
    return {} if given.aperture is None else {"aperture_radius": given.aperture, "focus_distance": given.focus}


def compile_picture(mesh: Mesh, camera: View) -> None:
    """Compile what `run_picture` uses, by a picture of two samples that is not kept."""
    from atra.light import MetallicRoughness, PathRenderer, Scene, Sun, accumulate

    scene = Scene(mesh, [MetallicRoughness()], lights=[Sun((0.3, -1.0, -0.2))])
    with PathRenderer(scene, camera, jitter="pixel") as renderer, TemporaryDirectory() as folder:
        for _ in accumulate(renderer, 2):
            pass
        renderer.save(Path(folder, "picture.png"), exposure="auto", tone="neutral")


def say_written(path: Path, stops: float | None) -> str:
    """A line that names the file, and the exposure of a PNG."""
    exposure = "" if stops is None else f", exposure {stops:+.2f} stops"
    return f"written: {printable(str(path))}{exposure}"


def _expose(renderer: Renderer, given: Namespace, path: Path) -> None:
    """All samples, with a line on stderr; an interruption says how to go on."""
    from atra.light import accumulate

    state = path.with_name(f"{path.name}.state")
    error = None if given.error is None else given.error / 100.0
    has_limit = any(getattr(given, name) is not None for name in _LIMITS)
    samples = given.samples if has_limit else SAMPLES
    if state.exists():
        print(f"atra: goes on with {printable(str(state))}", file=sys.stderr)
    with progress_line() as tell:
        try:
            for step in accumulate(renderer, samples, error=error, minutes=given.minutes, state=state):
                tell(say_progress(step, samples), step.is_done or step.samples & (step.samples - 1) == 0)
        except KeyboardInterrupt:
            if state.exists():
                print(f"\natra: the same command goes on from {printable(str(state))}", file=sys.stderr)
            raise
    if state.exists():
        print(f"atra: the error is not reached; the same command goes on from {printable(str(state))}", file=sys.stderr)


@contextmanager
def progress_line() -> Iterator[Callable[[str, bool], None]]:
    """Tells on standard error how far something is: one line that changes on a terminal; elsewhere a line for each text
    that is said to be worth it."""
    is_terminal = sys.stderr.isatty()

    def tell(text: str, is_worth_a_line: bool) -> None:
        if is_terminal or is_worth_a_line:
            print(text.ljust(60), end="\r" if is_terminal else "\n", file=sys.stderr, flush=True)

    yield tell
    if is_terminal:
        print(file=sys.stderr)


def say_progress(step: Progress, samples: int | None) -> str:
    """A line of how far a picture is. samples: the most it is to have; None: any number."""
    of = "" if samples is None else f" of {samples}"
    error = "" if step.error is None else f", error about {step.error:.1%}"
    left = f", {step.elapsed_s:.0f} s" if step.is_done else ""
    if step.left_s:
        left = f", about {step.left_s:.0f} s left" if step.left_s < 120 else f", about {step.left_s / 60:.0f} min left"
    return f"{step.samples}{of} samples{error}{left}"
