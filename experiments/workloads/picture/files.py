"""The pictures of one point as files."""

from __future__ import annotations

import base64
from pathlib import Path

from atra.files.paths import write_atomically
from experiments.harness.records import Record
from experiments.workloads.baselines import SINGLE


def write(folder: Path, record: Record) -> list[Path]:
    """`<scene>_<method>.png`, `<scene>_rtcIntersect1.png` and `<scene>_difference.png` in `folder`, made if missing;
    returns their paths. Raises StorageError."""
    scene, method = (record.configuration[name] for name in ("scene", "method"))
    written = []
    for name, picture in zip((method, SINGLE, "difference"), record.results["pictures"].values(), strict=True):
        path = folder / f"{scene}_{name}.png"
        write_atomically(path, base64.b64decode(picture))
        written.append(path)
    return written
