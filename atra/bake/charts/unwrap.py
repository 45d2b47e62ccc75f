"""Unwrapping: charts by xatlas, in a process of its own: an archive on standard input, another on standard output.

Run as a file, and so without this library, whose import would take longer than the charts of a small mesh.
"""

from __future__ import annotations

import io
import os
import sys

import numpy as np

UNMAPPED = -1


def main() -> None:
    """Reads vertices, faces, size, padding and texels_per_unit; writes uv, chart and size as of `Atlas`."""
    import xatlas

    answer = os.dup(1)
    os.dup2(2, 1)  # whatever libraries print is no answer
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as job:
        size, texels_per_unit = int(job["size"]), float(job["texels_per_unit"])
        maker = xatlas.Atlas()
        maker.add_mesh(job["vertices"], job["faces"])
        pack = xatlas.PackOptions()
        pack.padding, pack.bilinear, pack.create_image = int(job["padding"]), True, False
    pack.resolution = 0 if texels_per_unit else size
    pack.texels_per_unit = texels_per_unit
    maker.generate(xatlas.ChartOptions(), pack)
    _, corners, places = maker.get_mesh(0)
    of_atlas, of_chart = (numbers.astype(np.int64) for numbers in maker.get_mesh_vertex_assignment(0))
    placed = places.astype(np.float64) * (maker.width, maker.height)
    width, height = maker.width, maker.height
    if not texels_per_unit:  # xatlas meets the size approximately
        placed *= size / max(width, height)
        width = height = size
    chart = np.where((of_atlas[corners] == 0).all(axis=1), of_chart[corners[:, 0]], UNMAPPED)
    buffer = io.BytesIO()
    uv = np.clip(placed[corners], 0.0, (width, height))
    np.savez(buffer, uv=uv, chart=chart.astype(np.int32), size=np.array([width, height]))
    with os.fdopen(answer, "wb") as file:
        file.write(buffer.getvalue())


if __name__ == "__main__":
    main()
