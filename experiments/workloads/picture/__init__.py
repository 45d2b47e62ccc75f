"""Workload `picture`: shaded pictures of the method's hits and of rtcIntersect1's, and their difference."""

from __future__ import annotations

import base64
from contextlib import ExitStack

from atra.files.saving import encode_png
from atra.judge.compare import compare
from experiments.drawing.shading import difference_picture, shade
from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, counts, depth_errors
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_memory
from experiments.workloads.rounds import build_own, make_single, measured

PICTURE = Workload(
    name="picture",
    options=NoOptions,
    columns=(*RESOURCE_COLUMNS, *IMAGE_COLUMNS),
    headline=say_memory,
    package=__name__,
    needs=(*RESOURCES, *PIXELS, "pictures"),
)


def measure(point: Point) -> Measured:
    """Three PNG files in base64, and how the two images agree."""
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
    results["pictures"] = {name: base64.b64encode(encode_png(image)).decode() for name, image in images.items()}
    return measured(results | counts([agreement]) | depth_errors([agreement]))
