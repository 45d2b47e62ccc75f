"""Views of calibrated photographs
===============================

What calibrated photographs see of a mesh: many views, rendered here or by a cluster.

::

    python -m examples.calibrated_views --scene atrium --cluster dask
    python -m examples.calibrated_views --scene model --colmap sparse/0

The cameras are those of a COLMAP model, or a walk past the scene whose K, R and t are made here. Writes
`calibrated_views.png`, all views in a row.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path

import numpy as np

import atra
from examples import parts
from examples.clusters import CLUSTERS
from experiments.drawing.shading import shade


def walk(camera: atra.Camera, count: int) -> dict[str, atra.CalibratedCamera | atra.LensCamera]:
    """`count` steps to the right, by the matrices of a camera whose pixels are not square and whose principal point is
    not in the middle."""
    focal = 1 / camera.pixel_pitch
    K = np.array([[1.1 * focal, 0, 0.4 * camera.width], [0, focal, 0.6 * camera.height], [0, 0, 1]])
    away = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    cameras = {}
    for number, step in enumerate(np.linspace(-0.1, 0.1, count)):
        eye = camera.eye + step * away * camera.axes[0]
        R = atra.Camera(tuple(eye), camera.target, camera.up).axes
        cameras[f"view_{number:03}"] = atra.Camera.from_opencv(K, R, -R @ eye, camera.width, camera.height)
    return cameras


def main(arguments: list[str] | None = None) -> Mapping[str, atra.Hits]:
    made = parts.parser(__doc__, width=640, height=480)
    made.add_argument("--views", type=int, default=6)
    made.add_argument("--colmap", type=Path, help="folder of a COLMAP model whose cameras are taken")
    made.add_argument("--cluster", choices=sorted(CLUSTERS), help="who renders; otherwise this process")
    made.add_argument("--workers", type=int, default=2, help="processes of the cluster")
    options = made.parse_args(arguments)
    mesh, pose = parts.load(options.scene)
    if options.colmap:
        cameras: Mapping[str, atra.CalibratedCamera | atra.LensCamera] = atra.read_colmap(options.colmap)
    else:
        cameras = walk(atra.Camera(**pose, width=options.width, height=options.height), options.views)

    found = {}
    with CLUSTERS[options.cluster](options.workers) if options.cluster else nullcontext() as executor:
        for name, hits in atra.render_views(mesh, cameras, executor=executor, threads=options.threads):
            found[name] = hits
            print(f"{name}: depth {hits.depth.min():.4g} to {hits.depth[hits.hit].max(initial=0):.4g}")
    parts.save(
        options.out / "calibrated_views.png",
        parts.beside([parts.resized(shade(hits), 240, 180) for hits in found.values()]),
    )
    name, hits = next(iter(found.items()))
    with atra.PixelTracer(mesh, hits.camera, packet_width=1, threads=options.threads) as alone:
        print(f"{name} against single rays:", atra.compare(hits, alone.trace()))
    return found


if __name__ == "__main__":
    main()
