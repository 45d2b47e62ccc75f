"""Several frames at once
======================

Several frames at once: the camera moves, turns and zooms, and the mesh moves, too (paper §6, Fig. 8).

::

    python -m examples.frames --scene atrium --frames 8

All frames have the same rays once their geometry is carried into the first camera's space; one set of rays serves them
all. Writes `frames.png`, a sheet of the frames.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import atra
from examples import parts
from experiments.drawing.shading import shade


def walk(camera: atra.Camera, count: int) -> list[atra.Camera]:
    """The camera walks a tenth of the way to its target, looks a little to the side, and widens its view by a third."""
    view = np.subtract(camera.target, camera.eye)
    reach = float(np.linalg.norm(view))
    return [
        replace(
            camera,
            eye=tuple(camera.eye + 0.1 * share * view),
            target=tuple(camera.target + 0.25 * share * reach * camera.axes[0]),
            fov_y_degrees=camera.fov_y_degrees * (1 + share / 3),
        )
        for share in np.linspace(0, 1, count)
    ]


def lift(mesh: atra.Mesh, share: float) -> atra.Mesh:
    """The mesh with what is above its middle stretched upwards by `share`: vertices that differ from frame to frame."""
    low, high = mesh.bounds[:, 1]
    vertices = np.array(mesh.vertices)
    above = np.maximum(vertices[:, 1] - (low + high) / 2, 0)
    vertices[:, 1] += np.float32(share) * above
    return atra.Mesh(vertices, mesh.faces, mesh.name)


def main(arguments: list[str] | None = None) -> atra.Frames:
    made = parts.parser(__doc__, scene="atrium", width=512, height=512)
    made.add_argument("--frames", type=int, default=8)
    options = made.parse_args(arguments)
    mesh, pose = parts.load(options.scene)
    cameras = walk(atra.Camera(**pose, width=options.width, height=options.height), options.frames)
    meshes = [lift(mesh, 0.3 * share) for share in np.linspace(0, 1, options.frames)]
    split = atra.Split(*parts.largest_split(options.width, 64), options.width, options.height)
    with atra.FramesTracer(meshes, atra.Alignment.of_frames(cameras, split), threads=options.threads) as tracer:
        frames = tracer.trace()
        print(f"{len(frames)} frames, {tracer.triangle_count:,} triangles in one Embree scene")
    pictures = [parts.resized(shade(hits), options.width // 2, options.height // 2) for hits in frames]
    columns = min(4, len(pictures))
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % columns)
    rows = [parts.beside(pictures[start : start + columns]) for start in range(0, len(pictures), columns)]
    gap = np.full((4, rows[0].shape[1], 3), 255, np.uint8)
    parts.save(options.out / "frames.png", np.concatenate([part for row in rows for part in (gap, row)][1:]))
    for number, hits in enumerate(frames):
        with atra.PixelTracer(hits.mesh, hits.camera, packet_width=1, threads=options.threads) as alone:
            print(f"frame {number}, alone:", atra.compare(hits, alone.trace()))
    return frames


if __name__ == "__main__":
    main()
