"""What filters share: functions that Embree calls for every triangle that rays of a packet hit."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import store
from atra.compiled.store import njit
from atra.compiled.vectors import splat
from atra.embree.layout import FilterArguments, RayQueryContext

VALID, USER_DATA, CONTEXT = (
    FilterArguments.valid.offset,
    FilterArguments.user_data.offset,
    FilterArguments.context.offset,
)
RAY, HIT, RAY_COUNT = FilterArguments.ray.offset, FilterArguments.hit.offset, FilterArguments.ray_count.offset
_WRONG_WIDTH = RayQueryContext.wrong_width.offset


@njit
def refuse(context, valid, given):  # type: ignore[no-untyped-def]
    """Reject the hits of a packet of another width than was sent; `Workspace.wrong_width` then tells `given`."""
    store(splat(np.int64(given), 1), context + _WRONG_WIDTH)
    for lane in range(np.int64(given)):
        store(splat(np.int32(0), 1), valid + lane * 4)
