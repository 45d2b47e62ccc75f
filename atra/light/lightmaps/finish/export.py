"""Files of a lightmap: EXR for further work, PNG for viewing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.files.paths import write_atomically
from atra.files.saving import encode_exr
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.seams import Seams, dilated
from atra.light.lightmaps.maps import LIGHTS, Lightmap
from atra.light.pictures.files import png_of

_BRIGHT = 0.99
"""Quantile of the texels' luminance that is shown as white."""


def finished(lightmap: Lightmap, values: NDArray[np.float32], seams: Seams | None = None) -> NDArray[np.float32]:
    """(H, W, C) image of (N, C) values with gutters filled and, if `seams` are given, matched; several maps stacked
    vertically."""
    image = dilated(lightmap.texels, values, lightmap.valid)
    return image if seams is None else seams.stitched(image)


def exposure_of(lightmap: Lightmap) -> float:
    """The factor that scales light for display."""
    lit = lightmap.luminance[lightmap.valid]
    bright = float(np.quantile(lit, _BRIGHT)) if len(lit) else 0.0
    return 1.0 / bright if bright > 0.0 else 1.0


def save_maps(
    lightmap: Lightmap, folder: Path | str, *, stitch: bool = True, visible: NDArray[np.bool_] | None = None
) -> list[Path]:
    """Write each kind of light and the openness as linear EXR and PNG, occupancy and charts as PNG; returns the files.
    Several maps get numbered files.

    stitch: whether seams are matched. visible: (N,) bool, what a view shows, written as well. Raises InputError without
    the package OpenEXR, StorageError.
    """
    texels, folder = lightmap.texels, Path(folder)
    seams = Seams.of(texels.mesh, texels.atlas) if stitch else None
    exposure = exposure_of(lightmap)
    files: dict[str, bytes] = {}

    def keep(name: str, image: NDArray[Any], exposure: float = 1.0, *, exactly: bool = False) -> None:
        for tail, part in parts_of(texels.atlas, image):
            if exactly:
                channels = "RGB" if part.shape[2] == 3 else "Y"
                files[f"{name}{tail}.exr"] = encode_exr({one: part[..., k] for k, one in enumerate(channels)})
            files[f"{name}{tail}.png"] = png_of(np.broadcast_to(exposure * part, (*part.shape[:2], 3)))

    for name in LIGHTS:
        keep(name, finished(lightmap, lightmap.light(name), seams), exposure, exactly=True)
    keep("openness", finished(lightmap, lightmap.openness[:, None]), exactly=True)
    keep("occupancy", texels.occupied[..., None])
    if visible is not None:
        keep("culling_map", texels.image(0.2 + 0.8 * visible)[..., None])
    turns = texels.chart[:, None] * 0.618034 + (0.0, 1 / 3, 2 / 3)
    keep("charts", texels.image(0.5 + 0.4 * np.cos(2.0 * np.pi * turns)))
    for name, content in files.items():
        write_atomically(folder / name, content)
    return [folder / name for name in files]


def parts_of(atlas: Atlas, image: NDArray[Any]) -> list[tuple[str, NDArray[Any]]]:
    """The maps of an (H, W, C) image, with the suffixes of their names."""
    parts = np.split(image, atlas.maps)
    return [(f"_{number}" if len(parts) > 1 else "", part) for number, part in enumerate(parts)]
