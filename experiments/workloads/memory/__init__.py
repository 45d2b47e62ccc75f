"""Workload `memory`: what one method takes alone, with nothing else in the process."""

from __future__ import annotations

from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_memory
from experiments.workloads.workload import NoOptions, Workload

MEMORY = Workload(
    name="memory", options=NoOptions, columns=RESOURCE_COLUMNS, headline=say_memory, room=__name__, needs=RESOURCES
)
