"""`atra judge`: what is right in an image of a mesh that any program has made."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

import numpy as np

from atra.command.cameras import read_cameras
from atra.errors import InputError, printable
from atra.files.cameras.entries import Broken
from atra.files.depth_images import read_depth_image
from atra.files.meshes.loading import load_mesh
from atra.files.paths import write_atomically
from atra.files.saving import encode_png
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.conventions import Convention
from atra.judge.foreign import ForeignImage, ForeignJudgement, judge_image
from atra.judge.marks import mark_verdicts

EXAMPLES = """\
examples:
  atra judge depth.exr --mesh model.ply --camera cameras.json
  atra judge depth.png --depth-scale 1000 --mesh model.ply --camera cameras.json --view front
  atra judge mine.npz --against theirs.npz --mesh model.ply --camera cameras.json --picture where.png

The image holds depths, along the view axis or along the ray, and may name a triangle in each pixel. In a .npz these
are the arrays depth and prim_id, in a .exr such channels. The convention (rows, columns, pixel centres, kind of depth)
is found out and printed. Exit code: 0 if nothing is wrong, 1 if a pixel is wrong or a hole, 2 if the input cannot be
used. The harness writes built-in scenes as meshes with cameras: atra rays cornell_box
"""


KINDS = ("equal", "tied", "edge", "wrong", "hole")
"""Kinds of pixels that are counted; a hole is also wrong."""


def add_judge(parser: ArgumentParser) -> None:
    """Add the arguments of `run_judge`."""
    parser.epilog, parser.formatter_class = EXAMPLES, RawDescriptionHelpFormatter
    parser.add_argument("image", type=Path, help=".exr, .npz or .npy of depths in scene units, or a 16-bit .png")
    parser.add_argument("--mesh", type=Path, required=True, help="the mesh that it shows")
    parser.add_argument("--camera", type=Path, required=True, metavar="CAMERAS", help="as for `atra render`")
    parser.add_argument("--view", metavar="NAME", help="the camera's name, where the file has several")
    parser.add_argument("--against", type=Path, metavar="IMAGE", help="compare with this image, not with atra's own")
    parser.add_argument(
        "--depth-scale", type=float, default=1000.0, metavar="NUMBER",
        help="numbers of a 16-bit PNG per scene unit, as for `atra render` (default: 1000, millimetres of metres)",
    )  # fmt: skip
    parser.add_argument(
        "--rounding", type=float, metavar="UNITS",
        help="by how much the file may have rounded a depth (default: 0, for a PNG half of a step)",
    )  # fmt: skip
    parser.add_argument("--own", action="store_true", help="look for no other convention than atra's own")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="write marks where pixels are tied, edge, wrong")
    parser.add_argument("--explain", type=int, default=5, metavar="PIXELS", help="wrong pixels to explain (default: 5)")
    parser.add_argument("--json", action="store_true", help="print what is found as JSON")


def run_judge(given: Namespace) -> int:
    """Print the verdict; returns 0 if no pixel is wrong, else 1. Raises InputError and StorageError."""
    if given.picture is not None and given.picture.suffix.lower() != ".png":
        raise InputError(f"--picture is {given.picture}, expected a name that ends with .png")
    name, camera = _view(given)
    image = _image(given.image, given)
    against = None if given.against is None else _image(given.against, given)
    mesh = load_mesh(given.mesh)
    found = judge_image(mesh, camera, image, against=against, convention=Convention.own(camera) if given.own else None)
    if given.picture is not None:
        write_atomically(given.picture, encode_png(mark_verdicts(found.agreement.verdict)))
    print(json.dumps(as_json(found, given.explain), indent=1) if given.json else _said(found, image, name, given))
    return 0 if found.is_right else 1


def as_json(found: ForeignJudgement, most: int) -> dict[str, object]:
    """What is found, for programs."""
    agreement = found.agreement
    return {
        "right": found.is_right,
        "pixels": agreement.pixels,
        **{f"pixels_{kind}": getattr(agreement, f"pixels_{kind}") for kind in KINDS},
        "convention": {**vars(found.convention), "said": str(found.convention), "agreeing": found.agreeing},
        "own_convention_agreeing": found.own_agreeing,
        "explained": list(found.explained(most)),
    }


def _said(found: ForeignJudgement, image: ForeignImage, view: str, given: Namespace) -> str:
    agreement, is_own = found.agreement, found.convention == Convention.own(found.hits.camera)
    lines = [
        f"{printable(str(given.image))} of {printable(str(given.mesh))}, view {view!r}",
        f"convention  {found.convention}",
        f"            {found.agreeing:.2%} of pixels speak for it" + (
            ", atra's own" if is_own else f", {found.own_agreeing:.2%} for atra's own"
        ),
        f"pixels      {agreement}",
        *(f"            {one}" for one in found.explained(given.explain)),
    ]  # fmt: skip
    if given.picture is not None:
        lines.append(f"picture     {printable(str(given.picture))}: squares tied, diamonds edge, crosses wrong")
    if _shows_ids(image, given, found.reference):
        lines.append(f"hint        {printable(str(given.image))} holds triangle numbers, expected depths")
    wrong = "1 pixel is wrong" if agreement.pixels_wrong == 1 else f"{agreement.pixels_wrong:,} pixels are wrong"
    return "\n".join((*lines, "nothing is wrong" if found.is_right else wrong))


def _shows_ids(image: ForeignImage, given: Namespace, right: Hits) -> bool:
    """Whether most numbers of the file are the triangles that the right image shows: ids, or in a PNG ids + 1."""
    if image.depth.shape != right.depth.shape or not right.hit.any():
        return False
    is_png = given.image.suffix.lower() == ".png"
    numbers = np.rint(image.depth[right.hit] * given.depth_scale) - 1.0 if is_png else image.depth[right.hit]
    return bool((numbers == right.prim_id[right.hit]).mean() > 0.5)


def _view(given: Namespace) -> tuple[str, View]:
    left_out: Broken = {}
    cameras = read_cameras(given.camera, None, left_out)
    for name, error in left_out.items():
        print(f"atra: {printable(f'{name!r} is left out: {error}')}", file=sys.stderr)
    if given.view is None and len(cameras) > 1:
        raise InputError(f"{given.camera} has {len(cameras)} cameras, expected --view with one of {', '.join(cameras)}")
    name = next(iter(cameras)) if given.view is None else given.view
    if name not in cameras:
        raise InputError(f"--view is {name!r}, expected one of {', '.join(cameras)}")
    return name, cameras[name]


def _image(path: Path, given: Namespace) -> ForeignImage:
    if not 0.0 < given.depth_scale < float("inf"):
        raise InputError(f"--depth-scale is {given.depth_scale}, expected a number above 0")
    read = read_depth_image(path, given.depth_scale)
    try:
        return ForeignImage(read.depth, read.prim_id, read.rounding if given.rounding is None else given.rounding)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
