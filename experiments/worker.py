"""Measures one point in a process of its own: `python -m experiments.worker`, a job as a line on standard input."""

from __future__ import annotations

from experiments.harness.processes.worker import run_job
from experiments.registry import KINDS

if __name__ == "__main__":
    run_job(KINDS)
