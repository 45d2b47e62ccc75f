"""Workload `picture`: shaded pictures of the method's hits and of rtcIntersect1's, and their difference."""

from __future__ import annotations

import base64
from contextlib import ExitStack
from typing import TypedDict

from atra.files.saving import encode_png
from atra.judge.compare import compare
from experiments.drawing.shading import difference_picture, shade
from experiments.harness.point import Measured, Point
from experiments.workloads.images import Images, summed
from experiments.workloads.resources import Resources, say_memory
from experiments.workloads.rounds import build_own, make_single
from experiments.workloads.typed import workload


class Pictures(TypedDict):
    """PNG files in base64, by what they show."""

    pictures: dict[str, str]


PICTURE = workload("picture", __name__, say_memory, Resources, Images, Pictures)


def measure(point: Point) -> Measured:
    """Three pictures, and how the two images agree."""
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        single = stack.enter_context(make_single(point, own.mesh, own.camera))
        hits, reference = own.trace(), single.trace()
    agreement = compare(hits, reference)
    images = {
        "aligned": shade(hits),
        "pixel": shade(reference),
        "difference": difference_picture(hits, reference, agreement.verdict),
    }
    pictures = {name: base64.b64encode(encode_png(image)).decode() for name, image in images.items()}
    return Measured(results | {**summed([agreement]), **Pictures(pictures=pictures)})
