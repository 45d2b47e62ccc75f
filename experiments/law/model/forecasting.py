"""Forecasts: what a choice is predicted to cost on a view that was looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.law.model.choice import Choice
from experiments.law.model.constants import Machine
from experiments.law.model.formulas import NANO, build_terms, family, frame_terms
from experiments.law.model.looking import Look
from experiments.law.model.memory import array_bytes, byte_terms


@dataclass(frozen=True)
class Forecast:
    """What a choice is predicted to cost on one thread.

    build_s: plan and build. frame_time_s: each frame. bytes: memory of what is built.
    """

    choice: Choice
    build_s: float
    frame_time_s: float
    bytes: float


def forecast(look: Look, choice: Choice, want: str, known: Machine) -> Forecast:
    """What a choice costs on a view that was looked at."""
    constants = known.constants

    def of(name: str, terms: np.ndarray) -> float:
        return float(np.dot(terms, constants[name]))

    return Forecast(
        choice,
        of(f"{choice.method}|build", build_terms(look, choice)) * NANO,
        max(of(family(choice, want), frame_terms(look, choice, want)) * NANO, NANO),
        array_bytes(look, choice) + of(f"{choice.method}|bytes", byte_terms(look, choice)),
    )
