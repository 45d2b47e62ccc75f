"""Time of gathering: the point's own method and single rays and packets that gather the same, round by round."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from experiments.harness.point import Measured, Point
from experiments.workloads.baselines import OWN, SINGLE
from experiments.workloads.gather import DIFFERENCES
from experiments.workloads.rounds import (
    build_with_baselines,
    measured,
    own_and_baselines,
    plan_and_build_again,
    shrunk,
    timed_rounds,
    warm_up,
)

_EXACT_TO = 1e-5
"""Tolerance as a share of the image's largest value: thicknesses are differences of float32 depths."""

CLOSED = ((0, 1, 6), (1, 2, 6), (2, 0, 6), (2, 1, 0))
"""A tetrahedron, since thickness needs a closed mesh. The plane of one face contains the eye, so no copy can show it; a
corner in the eye would put every sample in doubt, which takes seconds to decide."""


class Gatherings:
    """Gathers again and again into the same arrays."""

    def __init__(self, tracer: Any, what: Reduction[Any]) -> None:
        self._tracer, self._what = tracer, what
        self.latest: Any = None

    def gather(self) -> None:
        self.latest = self._tracer.gather(self._what, out=self.latest)


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, and time it against the baselines. Raises InputError and
    MemoryBudgetError as the tracers do, and InputError for a mesh that is not for what is gathered."""
    what = point.workload_options.reduction
    warm_up(point, own_and_baselines(shrunk(point)), lambda tracer: tracer.gather(what), CLOSED)
    with ExitStack() as stack:
        tracers, results = build_with_baselines(point, stack)
        gatherings = {name: Gatherings(tracer, what) for name, tracer in tracers.items()}
        timed = timed_rounds(point, {name: one.gather for name, one in gatherings.items()})
        results |= differences(gatherings[OWN].latest, gatherings[SINGLE].latest, what)
        results |= plan_and_build_again(tracers[OWN])
    return measured(results, timed)


def differences(own: Any, single: Any, what: Reduction[Any]) -> dict[str, int]:
    """Differences of what was gathered, by the names of DIFFERENCES; hits are 0 where they are not counted."""
    differs: NDArray[np.bool_] = np.zeros((single.camera.height, single.camera.width), bool)
    hits = missing = too_many = 0
    for name in what.planes():
        ours, theirs = getattr(own, name), getattr(single, name)
        if name == "count":
            more = ours.astype(np.int64) - theirs
            hits, missing, too_many = int(theirs.sum()), int(-more[more < 0].sum()), int(more[more > 0].sum())
        differs |= _unlike(ours, theirs).reshape(-1, *differs.shape).any(axis=0)
    return dict(zip(DIFFERENCES, (hits, missing, too_many, int(differs.sum())), strict=True))


def _unlike(own: NDArray[Any], single: NDArray[Any]) -> NDArray[np.bool_]:
    if own.dtype.kind != "f":
        return own != single
    finite = np.isfinite(single)
    largest = np.abs(single[finite]).max(initial=0.0)
    return ~np.isclose(own, single, rtol=0, atol=_EXACT_TO * largest, equal_nan=True)
