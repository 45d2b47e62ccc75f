"""`atra plan` and `atra calibrate`: what each method costs on a view, and how fast this machine is."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from atra.command.cameras import read_cameras
from atra.files.meshes.loading import load_mesh
from atra.geometry.camera import Camera
from atra.geometry.view import View
from atra.model.calibrating import calibrate
from atra.model.constants import keep
from atra.model.planning import WANTS, plan


def add_plan(parser: ArgumentParser) -> None:
    """Add the arguments of `run_plan`."""
    parser.add_argument("mesh", type=Path, help="a file of any format that trimesh reads")
    parser.add_argument("--camera", type=Path, metavar="CAMERAS", help="as for atra render (default: frames the mesh)")
    parser.add_argument("--frames", type=int, default=64, help="frames of the view (default: 64)")
    parser.add_argument("--want", choices=WANTS, default="nearest", help="nearest hit, or one of all hits")
    parser.add_argument("--size", nargs=2, type=int, metavar=("WIDTH", "HEIGHT"), help="size of cameras without one")


def run_plan(given: Namespace) -> int:
    """Print a table of predictions for every camera; returns 0. Raises InputError."""
    mesh = load_mesh(given.mesh)
    size = None if given.size is None else tuple(given.size)
    if given.camera is not None:
        cameras: dict[str, View] = read_cameras(given.camera, size, {}, None)
    else:
        width, height = size or (1024, 1024)
        cameras = {given.mesh.stem: Camera.framing(mesh, width=width, height=height)}
    for name, camera in cameras.items():
        print(f"{name}: {given.frames} frames of {camera.width} x {camera.height} pixels, {given.want}, one thread")
        print(plan(mesh, camera, given.frames, given.want))
    return 0


def run_calibrate(given: Namespace) -> int:
    """Measure and keep the constants of this machine; returns 0. Raises StorageError."""
    constants = calibrate(lambda line: print(line, file=sys.stderr))
    print(f"constants of this machine are in {keep(constants)}")
    return 0
