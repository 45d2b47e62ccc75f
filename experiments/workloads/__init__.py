"""Workloads: what is measured at a point; adding one is a line here and its folder."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pkgutil import resolve_name
from typing import Any

from experiments.harness.options import NoOptions, find_named
from experiments.harness.point import Workload

OWN = {
    "frame": "experiments.workloads.frame:FRAME",
    "build": "experiments.workloads.build:BUILD",
    "memory": "experiments.workloads.memory:MEMORY",
    "picture": "experiments.workloads.picture:PICTURE",
    "agreement": "experiments.workloads.agreement:AGREEMENT",
    "multiframe": "experiments.workloads.multiframe:MULTIFRAME",
    "surface": "experiments.workloads.surface:SURFACE",
    "moving": "experiments.workloads.moving:MOVING",
    "gather": "experiments.workloads.gather:GATHER",
    "views": "experiments.workloads.views:VIEWS",
    "render": "experiments.light.render:RENDER",
    "bake": "experiments.light.bake:BAKE",
    "bake_rays": "experiments.light.bake_rays:BAKE_RAYS",
    "classification": "experiments.classification.workload:CLASSIFICATION",
    "rays": "experiments.workloads.rays:RAYS",
}
"""Name -> where the workload is defined, as entry points say it; in the order of tables and pages."""

WORKLOADS: tuple[Workload, ...]
"""All workloads in that order, those from outside last. They are imported when this is first asked for: a worker
measures one workload and imports no other."""

GROUP = "atra.workloads"
"""Group of entry points: `mine = "my_package.measuring:MY_WORKLOAD"`, a `Workload` of that name."""


def __getattr__(name: str) -> Any:
    if name != "WORKLOADS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals().setdefault(name, (*map(resolve_name, OWN.values()), *_outside()))


def _unusable(name: str, problem: str) -> Workload:
    return Workload(name, NoOptions, (), lambda record: "", Workload.__module__, problem=lambda point: problem)


@cache
def _outside() -> tuple[Workload, ...]:
    return tuple(_offered())


def _offered() -> Iterator[Workload]:
    """The workloads of installed packages; one that cannot be used has points that are skipped with the reason."""
    from experiments.harness.entry_points import offers

    for offer in offers(GROUP):
        usable = isinstance(offer.value, Workload) and offer.value.name == offer.name
        wrong = f"entry point {offer.name} of {GROUP} is no Workload of that name"
        if offer.name not in OWN:
            yield offer.value if usable else _unusable(offer.name, offer.problem or wrong)


def find_workload(name: str) -> Workload:
    """The workload called `name`; one of ours is imported alone. Raises InputError, naming those there are, for any
    other name."""
    if name in OWN:
        return resolve_name(OWN[name])  # type: ignore[no-any-return]
    return find_named("workload", globals().get("WORKLOADS") or _outside(), name, OWN)
