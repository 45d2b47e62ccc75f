"""Workloads: what is measured at a point; adding one is a line here and its folder, in a wing or a package an entry
point."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pkgutil import resolve_name
from typing import Any

from experiments.harness.entry_points import WORKLOADS_GROUP, offered, offers
from experiments.harness.options import NoOptions, find_named
from experiments.harness.point import Workload

CORE = {
    "frame": "experiments.workloads.frame:FRAME",
    "build": "experiments.workloads.build:BUILD",
    "memory": "experiments.workloads.memory:MEMORY",
    "picture": "experiments.workloads.picture:PICTURE",
    "agreement": "experiments.workloads.agreement:AGREEMENT",
    "multiframe": "experiments.workloads.multiframe:MULTIFRAME",
    "gather": "experiments.workloads.gather:GATHER",
    "views": "experiments.workloads.views:VIEWS",
    "rays": "experiments.workloads.rays:RAYS",
}
"""Name -> where the workload is defined, as entry points say it; in the order of tables and pages."""

WORKLOADS: tuple[Workload, ...]
"""All workloads: the core's in that order, those of wings and packages by name. They are imported when this is first
asked for: a worker measures one workload and imports no other."""


def __getattr__(name: str) -> Any:
    if name != "WORKLOADS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals().setdefault(name, (*map(resolve_name, CORE.values()), *_outside()))


def _unusable(name: str, problem: str) -> Workload:
    return Workload(name, NoOptions, (), lambda record: "", Workload.__module__, problem=lambda point: problem)


def _outside(names: Iterable[str] | None = None) -> Iterator[Workload]:
    """The workloads of wings and installed packages, by default all; one that cannot be used has points that are
    skipped with the reason."""
    for offer in offers(WORKLOADS_GROUP, names):
        usable = isinstance(offer.value, Workload) and offer.value.name == offer.name
        wrong = f"entry point {offer.name} of {WORKLOADS_GROUP} is no Workload of that name"
        if offer.name not in CORE:
            yield offer.value if usable else _unusable(offer.name, offer.problem or wrong)


def workload_names() -> list[str]:
    """The names of all workloads, none of which is imported for that."""
    return list(dict.fromkeys([*CORE, *offered(WORKLOADS_GROUP)]))


def find_workload(name: str) -> Workload:
    """The workload called `name`, imported alone. Raises InputError, naming those there are, for any other name."""
    if name in CORE:
        return resolve_name(CORE[name])  # type: ignore[no-any-return]
    return find_named("workload", globals().get("WORKLOADS") or _outside([name]), name, workload_names())
