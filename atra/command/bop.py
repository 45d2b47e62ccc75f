"""`atra render bop`: the labels of a BOP dataset."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from atra.compat.bop_datasets import write_labels
from atra.compiled.threads import resolve_threads
from atra.errors import printable

EXAMPLES = """\
atra render bop lmo --split test
           depth, masks, boxes and visible shares of every frame, to lmo_labels/test
       atra render bop lmo --split train_pbr --out labels --models models_eval --workers 8
           stopped and called again, it goes on where it stopped"""
"""What the help starts with."""


def add_bop(parser: ArgumentParser) -> None:
    """Add the arguments of `run_bop`."""
    parser.usage = EXAMPLES
    parser.add_argument("dataset", type=Path, help="a folder in BOP format: models, camera.json, and splits")
    parser.add_argument("--split", default="test", help="folder of the split (default: test)")
    parser.add_argument("--models", default="models", help="folder of the models (default: models)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where labels go (default: DATASET_labels)")
    parser.add_argument("--size", nargs=2, type=int, metavar=("WIDTH", "HEIGHT"), help="where camera.json has none")
    parser.add_argument("--workers", type=int, help="frames drawn at a time (default: as many as there are cores)")
    parser.add_argument("--saturate", action="store_true", help="clamp depths that do not fit 16 bits")


def run_bop(given: Namespace) -> int:
    """Write all labels; returns 1 if a frame could not be labelled. Raises InputError and StorageError."""
    size = None if given.size is None else tuple(given.size)
    out = given.out or given.dataset.with_name(f"{given.dataset.resolve().name}_labels")
    counts = {"done": 0, "kept": 0, "failed": 0}
    options = {"split": given.split, "models": given.models, "size": size, "saturate": given.saturate}
    for _, told in write_labels(given.dataset, out, resolve_threads(given.workers), **options):
        if told not in counts:
            print(f"atra: {printable(told)}", file=sys.stderr)
        counts[told if told in counts else "failed"] += 1
    kept = f", {counts['kept']:,} were there" if counts["kept"] else ""
    failed = f", {counts['failed']:,} failed" if counts["failed"] else ""
    print(f"{printable(str(out / given.split))}: {counts['done']:,} frames written{kept}{failed}")
    return 1 if counts["failed"] else 0
