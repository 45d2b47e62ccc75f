"""What the examples share: the scene asked for on the command line, clocks, and pictures as files."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import atra
from atra.files.saving import encode_png
from scenes.built_in import BUILT_IN
from scenes.loading import SceneSource, load_scene


def parser(description: str | None, **defaults: Any) -> argparse.ArgumentParser:
    """Scene, size and output folder; `defaults` replaces defaults."""
    made = argparse.ArgumentParser(description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    made.add_argument("--scene", default="cornell_box", help="a built-in scene, or one in the folder ATRA_SCENES")
    made.add_argument("--width", type=int, default=1024, help="pixels")
    made.add_argument("--height", type=int, default=1024, help="pixels")
    made.add_argument("--threads", type=int, default=1)
    made.add_argument("--out", type=Path, default=Path("results/examples"), help="folder for the pictures")
    made.set_defaults(**defaults)
    return made


def load(name: str) -> tuple[atra.Mesh, dict[str, Any]]:
    """A scene and the fields of its camera."""
    source = SceneSource.procedural if name in BUILT_IN else SceneSource.directory
    scene = load_scene(source, name, None)
    return scene.mesh, scene.camera


def largest_split(width: int, most: int) -> tuple[int, int]:
    """(nx, 1): the largest power of two up to `most` that divides the width."""
    return max(nx for nx in (2**k for k in range(16)) if nx <= most and width % nx == 0), 1


def save(path: Path, image: NDArray[np.uint8]) -> None:
    """(H, W, 3) uint8 RGB -> a PNG file; says where it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encode_png(image))
    print(path)


def beside(images: Sequence[NDArray[np.uint8]], gap_pixels: int = 4) -> NDArray[np.uint8]:
    """Images of one height in a row, with white between them."""
    gap = np.full((images[0].shape[0], gap_pixels, 3), 255, np.uint8)
    return np.concatenate([part for image in images for part in (gap, image)][1:], axis=1)


def resized(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 -> (height, width, 3) uint8, averaging what falls together."""
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BOX))
