"""Workloads: what is measured at a point; adding one is a line here and its folder."""

from __future__ import annotations

from experiments.harness.options import find_named
from experiments.harness.point import Workload
from experiments.workloads.agreement import AGREEMENT
from experiments.workloads.bake import BAKE
from experiments.workloads.bake_rays import BAKE_RAYS
from experiments.workloads.build import BUILD
from experiments.workloads.classification import CLASSIFICATION
from experiments.workloads.frame import FRAME
from experiments.workloads.gather import GATHER
from experiments.workloads.memory import MEMORY
from experiments.workloads.moving import MOVING
from experiments.workloads.multiframe import MULTIFRAME
from experiments.workloads.picture import PICTURE
from experiments.workloads.planner import PLANNER
from experiments.workloads.rays import RAYS
from experiments.workloads.render import RENDER
from experiments.workloads.surface import SURFACE
from experiments.workloads.views import VIEWS

WORKLOADS: tuple[Workload, ...] = (
    FRAME,
    BUILD,
    MEMORY,
    PICTURE,
    AGREEMENT,
    MULTIFRAME,
    PLANNER,
    SURFACE,
    MOVING,
    GATHER,
    VIEWS,
    RENDER,
    BAKE,
    BAKE_RAYS,
    CLASSIFICATION,
    RAYS,
)
"""In the order of tables and pages."""


def find_workload(name: str) -> Workload:
    """The workload called `name`. Raises InputError, naming those there are, for any other name."""
    return find_named("workload", WORKLOADS, name)
