"""Times from scene statistics: for each method a sum of counts times prices, fitted on recorded points.

`model.json` holds the prices and says what they were fitted on; `python -m benchmarks.fit_planner` makes it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp
from pathlib import Path
from typing import Any

from atra.planner.choice import Choice
from atra.planner.features import SceneStatistics, features
from atra.planner.plan import Forecast

MODEL_FILE = Path(__file__).with_name("model.json")

CAUTION = 1.0
"""How many standard deviations a method's predicted gain over packets must exceed for it to be chosen unmeasured."""


@dataclass(frozen=True)
class Law:
    """Seconds = sum of prices x counts (`atra.planner.features.features`), all prices at least 0.

    error: standard deviation of the logarithm of what the law says over what was measured, on scenes it was not fitted
    on; for frames of other methods than packets, of the ratio to packets.
    """

    prices_s: dict[str, float]
    error: float

    def __call__(self, counts: Mapping[str, float]) -> float:
        return sum(price_s * counts[name] for name, price_s in self.prices_s.items())


@dataclass(frozen=True)
class Model:
    """first, frame: laws by method: from nothing to the first frame, and every further frame.

    quality: by method and build quality, factors (first, frame) on the times with medium quality.
    fitted_on: machine, scenes, views and date, for people.
    """

    first: dict[str, Law]
    frame: dict[str, Law]
    quality: dict[str, dict[str, tuple[float, float]]]
    fitted_on: dict[str, Any]

    def forecast(self, statistics: SceneStatistics, choice: Choice, frames: int) -> Forecast:
        """What a choice is expected to take; its error is that of the total for so many frames."""
        counts = features(statistics, choice)
        first, frame = self.first[choice.method], self.frame[choice.method]
        of_first, of_frame = self.quality[choice.method].get(choice.build_quality, (1.0, 1.0))
        first_s, frame_time_s = first(counts) * of_first, frame(counts) * of_frame
        later_s = (frames - 1) * frame_time_s
        error = (first.error * first_s + frame.error * later_s) / (first_s + later_s)
        return Forecast(choice, first_s, frame_time_s, error, measured=False)

    def to_json(self) -> str:
        laws = {
            f"{what} {method}": {"error": law.error, "prices_s": law.prices_s}
            for what, of_what in (("first", self.first), ("frame", self.frame))
            for method, law in of_what.items()
        }
        fields = {"fitted_on": self.fitted_on, "laws": laws, "quality": self.quality}
        return json.dumps(fields, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Model:
        fields = json.loads(text)
        laws: dict[str, dict[str, Law]] = {"first": {}, "frame": {}}
        for name, law in fields["laws"].items():
            what, method = name.split(" ")
            laws[what][method] = Law(law["prices_s"], law["error"])
        quality = {
            method: {name: (factors[0], factors[1]) for name, factors in of_method.items()}
            for method, of_method in fields["quality"].items()
        }
        return cls(laws["first"], laws["frame"], quality, fields["fitted_on"])


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
