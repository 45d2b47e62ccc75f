"""Fit the planner's model to recorded points, and say how well it does on scenes it has not seen.

    python run.py sweep=planner_fit && python -m benchmarks.fit_planner     # writes atra/planner/model.json

Points with another build quality than medium tell only what that quality changes. Times are processor time of one
thread (`experiments.planner`); only their ratios carry over to another machine.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp, log
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.mesh import Mesh
from atra.planner.choice import METHODS, PACKETS, Choice
from atra.planner.estimate import MODEL_FILE, Law, Model
from atra.planner.features import SceneStatistics, features, scene_statistics
from atra.records import Record, read_record, write_atomically
from experiments.configuration import Quantity, SceneSource
from experiments.point import Point
from experiments.scene_loading import load_scene
from experiments.views import FITTING_SCENES, FITTING_VIEWS

_CELLS = ("log cell width", "log cell width squared")
LAWS = {
    "once packets": ("one", "log pixels", "log triangles"),
    "once aligned": ("one", "log pixels", "log triangles", "log copies"),
    "once visible_first": ("one", "log pixels", "log triangles", "log visible copies"),
    "frame packets": ("one", "log pixels", "log triangles", "log triangles visible", "log hits per ray", "hit share"),
    "frame aligned": (
        "one", "log pixels", "log triangles visible", "log copies", "log hits per ray", "hit share", *_CELLS,
    ),
    "frame visible_first": (
        "one", "log pixels", "log triangles visible", "log visible copies", "log hits per ray", "hit share", *_CELLS,
    ),
}  # fmt: skip
"""The features of each law. A frame of other methods than packets is a ratio to that of packets."""

RIDGE = 0.3
"""Penalty on the squares of coefficients of standardised features, in squared residuals: a few scenes must not be
followed into every corner."""


@dataclass(frozen=True)
class Sample:
    """A choice timed on a view; packets_frame_time_s is from the same rounds."""

    scene: str
    statistics: SceneStatistics
    choice: Choice
    once_s: float
    frame_time_s: float
    packets_frame_time_s: float


def read_samples(folder: Path) -> tuple[list[Sample], list[Record]]:
    """All samples of the fitting views and scenes among the records in `folder`, and the records they are from.

    Raises InputError if there is none, or a scene has changed since.
    """
    records = [read_record(folder, path.stem) for path in sorted(folder.glob("*.json"))]
    used = [record for record in records if record is not None and _is_for_fitting(record)]
    if not used:
        raise InputError(f"{folder} has no points to fit to; run `python run.py sweep=planner_fit` first")
    samples: list[Sample] = []
    for record in used:
        point = Point.from_fields(record.configuration)
        choices = [_choice(fields) for fields in record.results["candidates"]]
        statistics = scene_statistics(_mesh(point), point.camera, {choice.split[0] for choice in choices})
        frame = {name: median(values) for name, values in record.samples.items()}
        once = {fields["name"]: median(fields["once_s"]) for fields in record.results["candidates"]}
        packets_s = frame[str(choices[0])]
        samples += [
            Sample(point.scene, statistics, choice, once[str(choice)], frame[str(choice)], packets_s)
            for choice in choices
        ]
    return samples, used


def _is_for_fitting(record: Record) -> bool:
    configuration = record.configuration
    return (
        record.status == "ok"
        and configuration.get("quantity") == Quantity.planner.value
        and configuration.get("scene") in FITTING_SCENES
        and configuration.get("view") in FITTING_VIEWS
    )


def _mesh(point: Point) -> Mesh:
    return _load(point.scene_source, point.scene, point.scene_path)


@cache
def _load(source: str, name: str, path: str | None) -> Mesh:
    return load_scene(SceneSource(source), name, path)[0]


def _choice(fields: dict[str, Any]) -> Choice:
    names = ("method", "packet_width", "packet_rows", "build_quality")
    return Choice(split=(fields["split"][0], fields["split"][1]), **{name: fields[name] for name in names})


def fit_model(samples: Sequence[Sample], fitted_on: dict[str, Any]) -> Model:
    """Laws by ridge regression on the logarithms; their errors from leaving out one scene at a time."""
    medium = [sample for sample in samples if sample.choice.build_quality == "medium"]
    once: dict[str, Law] = {}
    frame: dict[str, Law] = {}
    for name, names in LAWS.items():
        what, method = name.split(" ")
        of_method = [sample for sample in medium if sample.choice.method == method]
        law = _fit_law(of_method, names, _log_once if what == "once" else _log_frame)
        (once if what == "once" else frame)[method] = law
    return Model(once, frame, _quality_factors(samples), fitted_on)


def _log_once(sample: Sample) -> float:
    return log(sample.once_s)


def _log_frame(sample: Sample) -> float:
    own = log(sample.frame_time_s)
    return own if sample.choice.method == PACKETS else own - log(sample.packets_frame_time_s)


def _fit_law(samples: Sequence[Sample], names: Sequence[str], target: Callable[[Sample], float]) -> Law:
    named = [features(sample.statistics, sample.choice) for sample in samples]
    x = np.array([[of_sample[name] for name in names] for of_sample in named])
    y = np.array([target(sample) for sample in samples])
    scenes = np.array([sample.scene for sample in samples])
    unexplained = []
    for scene in np.unique(scenes):
        left_out = scenes == scene
        if left_out.all():
            continue
        unexplained.append(y[left_out] - x[left_out] @ _ridge(x[~left_out], y[~left_out]))
    error = float(np.sqrt(np.mean(np.concatenate(unexplained) ** 2))) if unexplained else float(y.std())
    coefficients = _ridge(x, y)
    return Law({name: float(f"{value:.5g}") for name, value in zip(names, coefficients, strict=True)}, round(error, 4))


def _ridge(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of the columns of x, the first of which is constant and not penalised."""
    mean, scale = x[:, 1:].mean(axis=0), x[:, 1:].std(axis=0)
    scale[scale == 0.0] = 1.0
    standard = (x[:, 1:] - mean) / scale
    slopes = np.linalg.solve(standard.T @ standard + RIDGE * np.eye(len(mean)), standard.T @ (y - y.mean())) / scale
    return np.concatenate([[y.mean() - mean @ slopes], slopes])


def _quality_factors(samples: Sequence[Sample]) -> dict[str, dict[str, tuple[float, float]]]:
    """Geometric means of (once, frame) over those with medium quality, of the same choice on the same view."""

    def key(sample: Sample) -> tuple[Any, ...]:
        return id(sample.statistics), sample.choice.method, sample.choice.split

    medium = {key(sample): sample for sample in samples if sample.choice.build_quality == "medium"}
    factors: dict[str, dict[str, tuple[float, float]]] = {method: {} for method in METHODS}
    for method in METHODS:
        for quality in ("low", "high"):
            of_quality = [one for one in samples if (one.choice.method, one.choice.build_quality) == (method, quality)]
            if of_quality:
                once, frame = (
                    exp(np.mean([log(getattr(one, name) / getattr(medium[key(one)], name)) for one in of_quality]))
                    for name in ("once_s", "frame_time_s")
                )
                factors[method][quality] = (round(once, 3), round(frame, 3))
    return factors


def summarise(records: Sequence[Record], samples: Sequence[Sample]) -> dict[str, Any]:
    """What a model was fitted on, for the file and its readers."""
    environment = records[0].environment
    sizes = {f"{one.configuration['width']} x {one.configuration['height']}" for one in records}
    return {
        "cpu": environment["cpu"],
        "embree_version": environment["embree_version"],
        "threads": 1,
        "date": max(str(one.environment["taken_at"]) for one in records)[:10],
        "scenes": sorted({sample.scene for sample in samples}),
        "views": sorted({str(one.configuration["view"]) for one in records}),
        "sizes": sorted(sizes),
        "points": len(records),
        "samples": len(samples),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results"), help="results_dir of the sweep")
    parser.add_argument("--output", type=Path, default=MODEL_FILE)
    arguments = parser.parse_args()
    try:
        samples, records = read_samples(arguments.results / "records")
    except InputError as error:
        print(f"fit_planner: {error}", file=sys.stderr)
        return 2
    model = fit_model(samples, summarise(records, samples))
    write_atomically(arguments.output, model.to_json().encode())
    print(f"{len(samples)} samples of {len(records)} points; error of each law on a scene left out:")
    for what, laws in (("once", model.once), ("frame", model.frame)):
        for method, law in laws.items():
            print(f"  {what} {method}: {law.error:.3f}")
    print(f"wrote {arguments.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
