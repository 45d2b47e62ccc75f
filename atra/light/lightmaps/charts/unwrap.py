"""Charts by xatlas in a separate process: reads an archive from standard input, writes one to standard output.

Runs as a script, without importing the library, which would take longer than unwrapping a small mesh.
"""

from __future__ import annotations

import io
import os
import sys

import numpy as np

UNMAPPED = -1


def main() -> None:
    """Reads vertices, faces, size, padding and texels_per_unit; writes uv, chart and size as in `Atlas`."""
    import xatlas

    answer = os.dup(1)
    os.dup2(2, 1)  # prints of libraries must not mix with the answer
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as job:
        size, texels_per_unit = int(job["size"]), float(job["texels_per_unit"])
        maker = xatlas.Atlas()
        maker.add_mesh(job["vertices"], job["faces"])
        pack = xatlas.PackOptions()
        pack.padding, pack.bilinear, pack.create_image = int(job["padding"]), True, False
    pack.resolution = size
    pack.texels_per_unit = texels_per_unit
    maker.generate(xatlas.ChartOptions(), pack)
    _, corners, places = maker.get_mesh(0)
    of_map, of_chart = (numbers.astype(np.int32)[corners[:, 0]] for numbers in maker.get_mesh_vertex_assignment(0))
    # xatlas meets the size of a single map only approximately.
    placed = places.astype(np.float64) * (maker.width, maker.height) * (size / max(maker.width, maker.height))
    uv = np.clip(placed[corners], 0.0, size)
    uv[..., 1] += size * np.maximum(of_map, 0)[:, None]
    buffer = io.BytesIO()
    chart = np.where(of_map >= 0, of_chart, UNMAPPED).astype(np.int32)
    np.savez(buffer, uv=uv, chart=chart, size=np.array([size, size * maker.atlas_count, maker.atlas_count]))
    with os.fdopen(answer, "wb") as file:
        file.write(buffer.getvalue())


if __name__ == "__main__":
    main()
