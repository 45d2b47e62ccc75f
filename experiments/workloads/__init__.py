"""Workloads: what is measured at a point; adding one is a line here and its folder."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.harness.entry_points import offers
from experiments.harness.options import NoOptions, find_named
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
from experiments.workloads.rays import RAYS
from experiments.workloads.render import RENDER
from experiments.workloads.surface import SURFACE
from experiments.workloads.views import VIEWS

_OWN: tuple[Workload, ...] = (
    FRAME,
    BUILD,
    MEMORY,
    PICTURE,
    AGREEMENT,
    MULTIFRAME,
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

GROUP = "atra.workloads"
"""Group of entry points: `mine = "my_package.measuring:MY_WORKLOAD"`, a `Workload` of that name."""


def _unusable(name: str, problem: str) -> Workload:
    return Workload(name, NoOptions, (), lambda record: "", Workload.__module__, problem=lambda point: problem)


def _outside() -> Iterator[Workload]:
    """The workloads of installed packages; one that cannot be used has points that are skipped with the reason."""
    taken = {one.name for one in _OWN}
    for offer in offers(GROUP):
        usable = isinstance(offer.value, Workload) and offer.value.name == offer.name
        wrong = f"entry point {offer.name} of {GROUP} is no Workload of that name"
        if offer.name not in taken:
            yield offer.value if usable else _unusable(offer.name, offer.problem or wrong)


WORKLOADS: tuple[Workload, ...] = (*_OWN, *_outside())
"""In the order of tables and pages."""


def find_workload(name: str) -> Workload:
    """The workload called `name`. Raises InputError, naming those there are, for any other name."""
    return find_named("workload", WORKLOADS, name)
