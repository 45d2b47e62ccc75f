"""Times from scene statistics: a law per method that is linear in a few logarithms, fitted on recorded points.

`model.json` holds the coefficients and says what they were fitted on; `python -m benchmarks.fit_planner` makes it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp
from pathlib import Path
from typing import Any

from atra.planner.choice import PACKETS, Choice
from atra.planner.features import SceneStatistics, features
from atra.planner.plan import Forecast

MODEL_FILE = Path(__file__).with_name("model.json")

CAUTION = 1.0
"""How many standard deviations a method's predicted gain over packets must exceed for it to be chosen unmeasured."""


@dataclass(frozen=True)
class Law:
    """log(seconds) = sum of coefficients x features, or the logarithm of a ratio to packets.

    error: standard deviation of what the law leaves unexplained on scenes it was not fitted on.
    """

    coefficients: dict[str, float]
    error: float

    def __call__(self, named: Mapping[str, float]) -> float:
        return exp(sum(value * named[name] for name, value in self.coefficients.items()))


@dataclass(frozen=True)
class Model:
    """once, frame: laws by method; a frame of methods other than packets is a ratio to that of packets.

    quality: by method and build quality, factors (once, frame) on the times with medium quality.
    fitted_on: machine, scenes, views and date, for people.
    """

    once: dict[str, Law]
    frame: dict[str, Law]
    quality: dict[str, dict[str, tuple[float, float]]]
    fitted_on: dict[str, Any]

    def forecast(self, statistics: SceneStatistics, choice: Choice, frames: int) -> Forecast:
        """What a choice is expected to take; its error is that of the total for so many frames."""
        named = features(statistics, choice)
        once_s, frame_time_s = self.once[choice.method](named), self.frame[choice.method](named)
        error = self.once[choice.method].error * once_s
        if choice.method != PACKETS:
            frame_time_s *= self.frame[PACKETS](named)
            error += self.frame[choice.method].error * frames * frame_time_s
        error /= once_s + frames * frame_time_s
        of_once, of_frame = self.quality[choice.method].get(choice.build_quality, (1.0, 1.0))
        return Forecast(choice, once_s * of_once, frame_time_s * of_frame, error, measured=False)

    def to_json(self) -> str:
        laws = {
            f"{what} {method}": {"error": law.error, "coefficients": law.coefficients}
            for what, of_what in (("once", self.once), ("frame", self.frame))
            for method, law in of_what.items()
        }
        fields = {"fitted_on": self.fitted_on, "laws": laws, "quality": self.quality}
        return json.dumps(fields, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Model:
        fields = json.loads(text)
        laws: dict[str, dict[str, Law]] = {"once": {}, "frame": {}}
        for name, law in fields["laws"].items():
            what, method = name.split(" ")
            laws[what][method] = Law(law["coefficients"], law["error"])
        quality = {
            method: {name: (factors[0], factors[1]) for name, factors in of_method.items()}
            for method, of_method in fields["quality"].items()
        }
        return cls(laws["once"], laws["frame"], quality, fields["fitted_on"])


@cache
def load_model() -> Model:
    """The model that comes with the package."""
    return Model.from_json(MODEL_FILE.read_text(encoding="utf-8"))


def estimate(statistics: SceneStatistics, choices: Sequence[Choice], frames: int) -> list[Forecast]:
    """Forecasts of all choices, of which the first must be packets; the one to take first, then by their totals.

    Another method than packets is taken only if it gains more than the model's uncertainty, and something: where the
    model errs, packets are the safe choice.
    """
    model = load_model()
    forecasts = [model.forecast(statistics, choice, frames) for choice in choices]
    packets_s = forecasts[0].total_s(frames)
    ordered = sorted(forecasts, key=lambda one: one.total_s(frames))

    def surely_faster(one: Forecast) -> bool:
        return one.total_s(frames) * exp(CAUTION * one.error) < packets_s

    best = next((one for one in ordered if surely_faster(one)), forecasts[0])
    return [best, *(one for one in ordered if one is not best)]
