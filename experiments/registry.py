"""Everything that can be measured, as the command line, the worker and Hydra hand it to the harness."""

from __future__ import annotations

from experiments.harness.point import Kind, Kinds
from experiments.methods import find_method, method_names
from experiments.workloads import find_workload, workload_names

KINDS: Kinds = {"method": Kind(method_names, find_method), "workload": Kind(workload_names, find_workload)}
"""What a configuration chooses from, and how a worker finds what its point needs without importing the others."""
