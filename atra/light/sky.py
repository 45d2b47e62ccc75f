"""Skies: the light of rays that leave the scene."""

from __future__ import annotations

import os
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.reading import Allowance, read_regular_file
from atra.files.saving import check_package
from atra.light.checks import Colour, check_fields, checked_colour, checked_texels, set_fields

WHITE: Colour = (1.0, 1.0, 1.0)

_BYTES_PER_NUMBER, _BYTES_PER_PIXEL = 20, 44
"""Peak memory of reading a number of an EXR, and a pixel of a Radiance HDR."""

_LONGEST_RUN = 127
"""Most equal bytes that two bytes of a Radiance HDR encode."""

_LEAST_SHARE = -1e-3
"""Least radiance that is taken for rounding, over the mean of the panorama; resampling leaves such texels."""


@dataclass(frozen=True)
class GradientSky:
    """A vertical gradient, linear in the y of the unit direction; defaults as in "Ray Tracing in One Weekend".

    below: radiance straight down, linear RGB. above: radiance straight up. power: a factor.
    """

    below: Colour = WHITE
    above: Colour = (0.5, 0.7, 1.0)
    power: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, below=1e12, above=1e12, power=(0.0, 1e12))


NEUTRAL = GradientSky((0.45, 0.45, 0.45), (1.1, 1.1, 1.1))
"""Lights a file that has no lights."""


@dataclass(frozen=True, eq=False)
class PanoramaSky:
    """An image all around, in longitude and latitude.

    texels: (H, W, 3) radiance, linear RGB; row 0 is above (+y), the middle column looks along -z, those right of it
    along +x. It is interpolated between the middles of its texels. power: a factor. rotation_degrees: by which it is
    turned about +y, counterclockwise seen from above, from -360 to 360.
    """

    texels: NDArray[np.float32]
    power: float = 1.0
    rotation_degrees: float = 0.0

    def __post_init__(self) -> None:
        set_fields(self, texels=checked_texels("texels of a sky", self.texels))
        check_fields(self, power=(0.0, 1e12), rotation_degrees=(-360.0, 360.0))

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], power: float = 1.0, rotation_degrees: float = 0.0, *,
        memory_per_byte: float | None = None,
    ) -> PanoramaSky:  # fmt: skip
        """Read an EXR or Radiance HDR panorama. memory_per_byte and errors: as for `read_panorama`."""
        return cls(read_panorama(path, memory_per_byte=memory_per_byte), power, rotation_degrees)


Sky = GradientSky | PanoramaSky


def constant_sky(colour: Colour | float = WHITE, power: float = 1.0) -> GradientSky:
    """The same radiance from everywhere; black means no sky."""
    whole = checked_colour("colour of a sky", colour, 1e12)
    return GradientSky(whole, whole, power)


def read_panorama(path: str | os.PathLike[str], *, memory_per_byte: float | None = None) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB as stored, from an EXR or Radiance HDR file, which need not be trusted.

    memory_per_byte: limit on the memory of reading, as for `atra.load_mesh`. Radiance below 0 by at most a thousandth
    of the mean becomes 0, with a warning. Raises InputError naming the file: for another suffix, damage, a size beyond
    its bytes or memory_per_byte, radiance that is NaN, infinite or further below 0, an EXR without R, G and B, and
    without the package OpenEXR.
    """
    path = Path(path)
    readers = {".exr": _read_exr, ".hdr": _read_hdr}
    if path.suffix.lower() not in readers:
        raise InputError(f"the sky {str(path)!r} has the suffix {path.suffix!r}, expected .exr or .hdr")
    if not path.is_file():
        raise InputError(f"the sky {str(path)!r} is no file")
    try:
        allowance = Allowance(path.stat().st_size, memory_per_byte)
        texels, note = _without_rounding(readers[path.suffix.lower()](path, allowance))
        checked = checked_texels("its radiance", texels)
    except (OSError, MemoryError, ValueError) as error:
        raise InputError(f"the sky {str(path)!r} cannot be used: {error}") from None
    if note:
        warnings.warn(f"{printable(path.name)}: {note}", stacklevel=2)
    return checked


def _without_rounding(texels: NDArray[np.float32]) -> tuple[NDArray[np.float32], str]:
    """Texels whose numbers slightly below 0 are 0, and a note that counts them; as they are where one is clearly
    negative or not finite."""
    lowest, mean = float(texels.min(initial=0.0)), float(texels.mean(dtype=np.float64)) if texels.size else 0.0
    if not _LEAST_SHARE * mean <= lowest < 0.0:
        return texels, ""
    count = int((texels < 0.0).any(axis=2).sum())
    return np.maximum(texels, 0.0), f"{count:,} texels below 0, the lowest {lowest:.3g}, are taken as 0"


def _read_exr(path: Path, allowance: Allowance) -> NDArray[np.float32]:
    check_package(".exr")
    import OpenEXR

    try:  # `File` raises for damage; `InputFile` would crash
        with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            floats = sum(_promised(part.header) for part in file.parts)
        allowance.check(f"{floats:,} numbers", floats * _BYTES_PER_NUMBER)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(one.pixels, np.float32) for name, one in file.channels().items()}
    except InputError:
        raise
    except Exception as error:  # the package raises many types
        raise InputError(str(error).replace(str(path), "it") or "it is damaged") from None
    if not {"R", "G", "B"} <= channels.keys():
        raise InputError(f"its channels are {', '.join(channels)}, expected R, G and B")
    return np.stack([channels[name] for name in "RGB"], axis=2)


def _promised(header: dict[str, Any]) -> int:
    """Numbers in a part of an EXR. Raises InputError for anything but a flat image."""
    if header["type"].name not in ("scanlineimage", "tiledimage"):
        raise InputError("it holds something else than flat images")
    low, high = (corner.astype(np.int64) for corner in header["dataWindow"])
    width, height = (high - low + 1).tolist()
    if width < 1 or height < 1:
        raise InputError(f"it has {width} x {height} pixels")
    return int(width * height * len(header["channels"]))


def _read_hdr(path: Path, allowance: Allowance) -> NDArray[np.float32]:
    """Source: the format of G. Ward's Radiance, from its manual "Radiance File Formats"."""
    content = read_regular_file(path)
    head, _, rest = content.partition(b"\n\n")
    size, _, data = rest.partition(b"\n")
    lines = head.split(b"\n")
    found = re.fullmatch(rb"-Y (\d{1,9}) \+X (\d{1,9})", size)
    if lines[0] not in (b"#?RADIANCE", b"#?RGBE") or b"FORMAT=32-bit_rle_rgbe" not in lines or not found:
        raise InputError("expected #?RADIANCE, FORMAT=32-bit_rle_rgbe, and a size as -Y 512 +X 1024")
    height, width = int(found[1]), int(found[2])
    allowance.check(f"{width:,} x {height:,} pixels", width * height * _BYTES_PER_PIXEL)
    start = bytes((2, 2, width >> 8 & 255, width & 255))
    if len(data) == 4 * height * width and not data.startswith(start):
        encoded = np.frombuffer(data, np.uint8).reshape(height, width, 4)
    else:
        encoded = _decoded(data, height, width, start)
    exponent = encoded[..., 3:].astype(np.int32)
    scale = np.where(exponent > 0, np.ldexp(np.float32(1.0), exponent - 136), np.float32(0.0))
    return np.multiply(encoded[..., :3], scale, dtype=np.float32)


def _decoded(data: bytes, height: int, width: int, start: bytes) -> NDArray[np.uint8]:
    """(H, W, 4) from run-length encoded rows, channel by channel; each row begins with `start`."""
    fewest = height * (4 + 8 * -(-width // _LONGEST_RUN))
    if not 0 < width < 1 << 15 or not 0 < fewest <= len(data):
        raise InputError(f"its {len(data)} bytes of pixels promise {width} x {height}")
    rows = np.empty((height, 4, width), np.uint8)
    at = 0
    for number, row in enumerate(rows):
        if data[at : at + 4] != start:
            raise InputError(f"row {number} does not begin as a row of {width} pixels does")
        at += 4
        for line in row:
            place = 0
            while place < width:
                first = data[at] if at < len(data) else 0
                count, bytes_taken = (first - 128, 1) if first > 128 else (first, first)
                taken = data[at + 1 : at + 1 + bytes_taken]
                if not 0 < count <= width - place or len(taken) != bytes_taken:
                    raise InputError(f"row {number} is damaged")
                line[place : place + count] = np.frombuffer(taken, np.uint8)
                place, at = place + count, at + 1 + bytes_taken
    return np.swapaxes(rows, 1, 2)
