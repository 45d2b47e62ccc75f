"""Files and tables as text that fits into a page: base64, compressed where the browser can undo it."""

from __future__ import annotations

import base64
import gzip
import io
import re
from dataclasses import dataclass

import pandas as pd
from PIL import Image, UnidentifiedImageError

from atra.errors import InputError
from experiments.report.contents import ReportFigure


@dataclass(frozen=True)
class EmbeddedImage:
    """An image as it stands in the page.

    packed: gzip in base64 for a script to unpack, or None; uri: data URI for `src`, or None. One of them is set.
    width, height: in CSS pixels, for the layout before it is shown.
    """

    packed: str | None
    uri: str | None
    width: int
    height: int


def base64_text(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def pack(content: bytes) -> str:
    """gzip, then base64; equal content gives equal text."""
    return base64_text(gzip.compress(content, compresslevel=9, mtime=0))


def data_uri(content: bytes, media_type: str) -> str:
    return f"data:{media_type};base64,{base64_text(content)}"


def embed_figure(figure: ReportFigure) -> EmbeddedImage:
    """An SVG is packed: text of coordinates shrinks to a seventh, which is what lets eight of them fit. A PNG stays.

    Raises InputError if the image is neither.
    """
    if figure.image.startswith(b"\x89PNG"):
        width, height = png_size(figure.image, figure.name)
        return EmbeddedImage(None, data_uri(figure.image, "image/png"), width, height)
    box = re.search(rb'<svg\b[^>]*\bviewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"', figure.image)
    if box is None:
        raise InputError(f"figure {figure.name} is neither a PNG nor an SVG with a viewBox")
    # matplotlib's viewBox is in points; 96 CSS pixels are 72 points.
    width, height = (round(float(side) * 96 / 72) for side in box.groups())
    return EmbeddedImage(pack(figure.image), None, width, height)


def png_size(content: bytes, name: str) -> tuple[int, int]:
    """Width and height in pixels. Raises InputError naming the picture if it cannot be read."""
    try:
        with Image.open(io.BytesIO(content)) as image:
            return image.size
    except (UnidentifiedImageError, OSError) as error:
        raise InputError(f"picture {name} cannot be read as an image: {error}") from None


def parquet_bytes(table: pd.DataFrame) -> bytes:
    """The content of `table.parquet`, as `experiments.results.table.write_table` writes it."""
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    return buffer.getvalue()
