"""Workload `memory`: what one method takes alone, with nothing else in the process."""

from __future__ import annotations

from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_memory

MEMORY = Workload(
    name="memory", options=NoOptions, columns=RESOURCE_COLUMNS, headline=say_memory, room=__name__, needs=RESOURCES
)
