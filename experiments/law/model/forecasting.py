"""Forecasts: what a choice is predicted to cost on a view that was looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from atra.compiled.instruction_sets import chosen_instruction_set, instruction_sets_here
from experiments.law.model.choice import Choice
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.formulas import NANO, Constants, build_terms, family, frame_terms
from experiments.law.model.looking import Look
from experiments.law.model.memory import array_bytes, byte_terms


@dataclass(frozen=True)
class Forecast:
    """What a choice is predicted to cost on one thread.

    build_s: plan and build. frame_time_s: each frame. bytes: memory of what is built.
    """

    build_s: float
    frame_time_s: float
    bytes: float


def known_constants() -> Constants:
    """The constants of the instruction set that kernels are compiled for; those of AVX2 where it has none."""
    here = chosen_instruction_set() or (instruction_sets_here() or ("",))[-1]
    return DEFAULTS.get(here, DEFAULTS["avx2"])


def forecast(look: Look, choice: Choice, want: str, constants: Constants) -> Forecast:
    """What a choice costs on a view that was looked at. want: nearest, or another word for all hits."""

    def cost_of(name: str, terms: np.ndarray) -> float:
        return float(np.dot(terms, constants[name]))

    return Forecast(
        cost_of(f"{choice.method}|build", build_terms(look, choice)) * NANO,
        max(cost_of(family(choice, want), frame_terms(look, choice, want)) * NANO, NANO),
        array_bytes(look, choice) + cost_of(f"{choice.method}|bytes", byte_terms(look, choice)),
    )
