"""Fit the planner's model to recorded points, and say how well it does on scenes it has not seen.

    python run.py sweep=planner_fit && python -m benchmarks.fit_planner     # writes atra/planner/model.json

Points with another build quality than medium tell only what that quality changes. Times are processor time of one
thread (`experiments.workloads.planner.measure`); only their ratios carry over to another machine.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import exp, log
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files import write_atomically
from atra.geometry.mesh import Mesh
from atra.planner.choice import METHODS, PACKETS, Choice
from atra.planner.estimate import MODEL_FILE, Law, Model
from atra.planner.features import SceneStatistics, features, scene_statistics
from experiments.harness.configuration import Quantity, SceneSource
from experiments.harness.point import Point
from experiments.harness.records import Record, read_record
from experiments.harness.scene_loading import load_scene
from experiments.harness.views import FITTING_SCENES, FITTING_VIEWS

LAWS = {
    "first packets": ("view", "pixels", "triangles", "hits"),
    "first aligned": ("view", "pixels", "triangles", "copies", "hits", "copies' outlines"),
    "first visible_first": (
        "view", "pixels", "triangles", "triangles in view", "visible copies", "hits", "visible copies' outlines",
    ),
    "frame packets": (
        "pixels", "first hits", "first hits x levels", "hidden hits", "outlines", "hidden outlines",
    ),
    "frame aligned": (
        "pixels", "hits", "copies", "copies x cell width", "copies' outlines", "boxes",
        "reference rays x levels",
    ),
    "frame visible_first": (
        "pixels", "first hits", "hidden hits", "visible copies", "visible copies x cell width",
        "visible copies' outlines", "outlines", "visible boxes", "reference rays x levels",
    ),
}  # fmt: skip
"""What each law may put a price on."""


@dataclass(frozen=True)
class Sample:
    """A choice timed on a view; samples of one view share its statistics."""

    scene: str
    statistics: SceneStatistics
    choice: Choice
    first_s: float
    frame_time_s: float


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
        first = {fields["name"]: median(fields["first_s"]) for fields in record.results["candidates"]}
        samples += [
            Sample(point.scene, statistics, choice, first[str(choice)], frame[str(choice)]) for choice in choices
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
    """Laws by least squares on relative errors; their own errors by leaving out one scene at a time."""
    medium = [sample for sample in samples if sample.choice.build_quality == "medium"]
    laws: dict[str, dict[str, Law]] = {"first": {}, "frame": {}}
    for name, names in LAWS.items():
        what, method = name.split(" ")
        prices = _fit([one for one in medium if one.choice.method == method], names, what)
        priced = {name: float(f"{price_s:.4g}") for name, price_s in zip(names, prices, strict=True) if price_s > 0}
        laws[what][method] = Law(priced, round(_left_out_error(medium, what, method), 4))
    return Model(laws["first"], laws["frame"], _quality_factors(samples), fitted_on)


def _left_out_error(samples: Sequence[Sample], what: str, method: str) -> float:
    """Root mean square of log(forecast / measured) over all scenes, each forecast from the others; for frames of other
    methods than packets, what is left of it beside the same error of packets on the same view."""
    unexplained: list[float] = []
    scenes = {sample.scene for sample in samples}
    for scene in scenes if len(scenes) > 1 else ():
        log_ratio: dict[int, float] = {}
        for one in (PACKETS, method) if what == "frame" else (method,):
            of_method = [sample for sample in samples if sample.choice.method == one]
            names = LAWS[f"{what} {one}"]
            prices = _fit([sample for sample in of_method if sample.scene != scene], names, what)
            for sample in [sample for sample in of_method if sample.scene == scene]:
                forecast_s = float(_counts(sample, names) @ prices)
                error = log(max(forecast_s, 1e-9) / _measured_s(sample, what))
                if one == PACKETS:
                    log_ratio[id(sample.statistics)] = error
                if one == method:
                    beside = log_ratio.get(id(sample.statistics), 0.0) if method != PACKETS else 0.0
                    unexplained.append(error - beside)
    return float(np.sqrt(np.mean(np.square(unexplained)))) if unexplained else 1.0


def _measured_s(sample: Sample, what: str) -> float:
    return sample.first_s if what == "first" else sample.frame_time_s


def _counts(sample: Sample, names: Sequence[str]) -> NDArray[np.float64]:
    named = features(sample.statistics, sample.choice)
    return np.array([named[name] for name in names])


def _fit(samples: Sequence[Sample], names: Sequence[str], what: str) -> NDArray[np.float64]:
    """Prices at which forecast / measured is nearest to 1; what would have a negative price is left out, worst first.

    Work cannot take less than no time, and without this bound the laws would be of no use beyond what they were
    fitted on.
    """
    shares = np.array([_counts(sample, names) / max(_measured_s(sample, what), 1e-6) for sample in samples])
    scale = np.linalg.norm(shares, axis=0)
    scale[scale == 0.0] = 1.0
    prices = np.zeros(len(names))
    kept = list(range(len(names)))
    while kept:
        found = np.linalg.lstsq(shares[:, kept] / scale[kept], np.ones(len(samples)), rcond=None)[0]
        if (found >= 0.0).all():
            prices[kept] = found / scale[kept]
            break
        kept.pop(int(np.argmin(found)))
    return prices


def _quality_factors(samples: Sequence[Sample]) -> dict[str, dict[str, tuple[float, float]]]:
    """Geometric means of (first, frame) over those with medium quality, of the same choice on the same view."""

    def key(sample: Sample) -> tuple[Any, ...]:
        return id(sample.statistics), sample.choice.method, sample.choice.split

    medium = {key(sample): sample for sample in samples if sample.choice.build_quality == "medium"}
    factors: dict[str, dict[str, tuple[float, float]]] = {method: {} for method in METHODS}
    for method in METHODS:
        for quality in ("low", "high"):
            of_quality = [one for one in samples if (one.choice.method, one.choice.build_quality) == (method, quality)]
            if of_quality:
                first, frame = (
                    exp(np.mean([log(getattr(one, name) / getattr(medium[key(one)], name)) for one in of_quality]))
                    for name in ("first_s", "frame_time_s")
                )
                factors[method][quality] = (round(first, 3), round(frame, 3))
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
    for what, laws in (("first", model.first), ("frame", model.frame)):
        for method, law in laws.items():
            print(f"  {what} {method}: {law.error:.3f}")
    print(f"wrote {arguments.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
