"""Shade the hits of the point's method and of rtcIntersect1, and mark where they differ."""

from __future__ import annotations

import base64
from contextlib import ExitStack

from atra.judge.compare import compare
from experiments.drawing.shading import difference_picture, encode_png, shade
from experiments.harness.point import Measured, Point
from experiments.workloads.columns import counts, depth_errors
from experiments.workloads.rounds import build_own, make_single, measured


def measure(point: Point) -> Measured:
    """Three PNG files in base64, and how the two images agree."""
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        single = stack.enter_context(make_single(point, own.mesh, own.camera))
        hits, reference = own.trace(), single.trace()
        agreement = compare(own.mesh, own.camera, hits, reference)
    images = {
        "aligned": shade(hits),
        "pixel": shade(reference),
        "difference": difference_picture(hits, reference, agreement.verdict),
    }
    results["pictures"] = {name: base64.b64encode(encode_png(image)).decode() for name, image in images.items()}
    return measured(results | counts([agreement]) | depth_errors([agreement]))
