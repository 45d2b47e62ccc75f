"""A worker's result is believed only if it can be true: everything else is refused with the reason."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import pytest

from experiments.harness.outcome import Outcome
from experiments.harness.point import Point
from experiments.methods.aligned import AlignedOptions
from experiments.workloads.multiframe import MultiframeOptions
from experiments.workloads.workload import NoOptions

POINT = Point(
    scene="box", scene_source="procedural", scene_path=None, mesh_sha256="0", triangles=1, view="own",
    eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov_y_degrees=60.0, width=8, height=8,
    method="aligned", options=AlignedOptions(split_x=1, packet_width=1), workload="frame", workload_options=NoOptions(),
    threads=1, ties="lowest", build_quality="medium", rounds=4, warmup=1, frame_budget_s=1.0, time_limit_s=30.0,
    memory_budget_gib=1.0,
)  # fmt: skip
MEMORY = {"triangles_traced": 1, "packet_width": 1, "threads": 1, "rss_bytes": 100, "peak_rss_bytes": 120}
COUNTS = {"pixels_equal": 60, "pixels_tied": 2, "pixels_edge": 1, "pixels_wrong": 1}
TIMES = {"plan_time_s": 0.0, "build_time_s": 0.1, "baseline_build_time_s": 0.1, "rounds": 3}
ROUNDS = {"rounds": 4}
METHODS = ("own", "rtcIntersect1", "packets_8")
GOOD = Outcome(
    "ok",
    on_purpose=True,
    warmup_samples={name: [1.0] for name in METHODS},
    samples={name: [0.5, 0.25, 0.5] for name in METHODS},
    results=MEMORY | COUNTS | TIMES,
)


def edited(edit: Callable[[dict[str, Any]], object], outcome: Outcome = GOOD) -> bytes:
    """The good result as a worker writes it, but for `edit`."""
    told = json.loads(outcome.to_json(POINT))
    edit(told)
    return json.dumps(told).encode()


def test_a_good_result_comes_through_unchanged() -> None:
    assert Outcome.from_json(GOOD.to_json(POINT), POINT) == GOOD


def timed(*names: str) -> dict[str, Any]:
    return {"warmup_samples": {name: [1.0] for name in names}, "samples": {name: [1.0] * 4 for name in names}}


@pytest.mark.parametrize(
    ("point", "changes"),
    [
        (replace(POINT, workload="memory"), timed() | {"results": MEMORY}),
        (replace(POINT, workload="build"), timed("plan", "build", "baseline_build") | {"results": MEMORY | ROUNDS}),
        (replace(POINT, workload="picture"), timed() | {"results": MEMORY | COUNTS | {"pictures": {}}}),
        (
            replace(POINT, workload="multiframe", workload_options=MultiframeOptions()),
            timed(*METHODS, "separate", "visible_first")
            | {"results": MEMORY | COUNTS | TIMES | ROUNDS | {"pixels_equal": 124}},
        ),
    ],
)
def test_each_workload_has_results_of_its_own(point: Point, changes: dict[str, Any]) -> None:
    outcome = replace(GOOD, **changes)
    assert Outcome.from_json(outcome.to_json(point), point) == outcome
    with pytest.raises(ValueError, match=r"without|samples of|128 together, of 64"):
        Outcome.from_json(outcome.to_json(POINT), POINT)


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\x00\xff", b"{", b"null", b"[1, 2]", b'"ok"', b"{}", b'{"status": "ok"}',
        GOOD.to_json(POINT)[:-200], GOOD.to_json(POINT) * 2,
    ],
)  # fmt: skip
def test_what_is_no_result_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"Expecting|expected|decode|Extra data|delimiter|Unterminated"):
        Outcome.from_json(content, POINT)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.5, 0, 0.0, True, None, "0.5", [0.5], 10**400])
def test_a_sample_that_is_no_time_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"a sample of packets_8 is|no number"):
        Outcome.from_json(edited(lambda told: told["samples"]["packets_8"].__setitem__(1, value)), POINT)
    with pytest.raises(ValueError, match=r"a sample of own is|no number"):
        Outcome.from_json(edited(lambda told: told["warmup_samples"]["own"].__setitem__(0, value)), POINT)


@pytest.mark.parametrize("constant", [b"NaN", b"Infinity", b"-Infinity"])
def test_what_json_has_no_number_for_is_refused_wherever_it_stands(constant: bytes) -> None:
    content = edited(lambda told: told["results"].update(anything=[{"deep": 12345}])).replace(b"12345", constant)
    with pytest.raises(ValueError, match=f"it holds {constant.decode()}"):
        Outcome.from_json(content, POINT)


def test_a_number_too_large_for_a_float_is_refused() -> None:
    content = GOOD.to_json(POINT).replace(b'"build_time_s": 0.1', b'"build_time_s": 1e999')
    with pytest.raises(ValueError, match="build_time_s is inf"):
        Outcome.from_json(content, POINT)


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda told: told["samples"]["own"].pop(), "one count for all"),
        (lambda told: told["samples"].pop("packets_8"), "samples of"),
        (lambda told: told["samples"].update(another=[1.0, 1.0, 1.0]), "samples of"),
        (lambda told: told.update(samples={}), "samples of"),
        (lambda told: told.update(samples=[1.0]), "expected lists of seconds"),
        (lambda told: told.update(samples={"own": 1.0}), "expected lists of seconds"),
        (lambda told: [values.clear() for values in told["samples"].values()], "0 rounds"),
        (lambda told: [values.pop() for values in told["samples"].values()], "2 rounds"),
        (lambda told: [values.extend([1.0] * 2) for values in told["samples"].values()], "5 rounds"),
        (lambda told: told["results"].update(rounds=4), "3 rounds of samples, 4 by its account"),
        (lambda told: [values.clear() for values in told["warmup_samples"].values()], "0 warm-up rounds, expected 1"),
    ],
)
def test_samples_that_are_not_rounds_of_every_method_are_refused(
    edit: Callable[[dict[str, Any]], object], reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        Outcome.from_json(edited(edit), POINT)


@pytest.mark.parametrize(
    ("results", "reason"),
    [
        ({"pixels_equal": 61}, "65 together, of 64"),
        ({"pixels_equal": 0}, "4 together, of 64"),
        ({"pixels_wrong": -1, "pixels_equal": 62}, "pixels_wrong is -1"),
        ({"pixels_tied": 2.0}, "pixels_tied is 2.0, expected a whole number"),
        ({"pixels_edge": True}, "pixels_edge is True"),
        ({"build_time_s": -1.0}, "build_time_s is -1.0"),
        ({"build_time_s": "fast"}, "build_time_s is 'fast'"),
        ({"plan_samples_s": [0.1, -0.1]}, "a sample of plan_samples_s is -0.1"),
        ({"rss_bytes": 2**70}, "rss_bytes is"),
        ({"embree_bytes": None}, "embree_bytes is None"),
    ],
)
def test_results_that_do_not_add_up_are_refused(results: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        Outcome.from_json(edited(lambda told: told["results"].update(results)), POINT)


@pytest.mark.parametrize("name", sorted(GOOD.results))
def test_ok_with_a_result_missing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name if name != "rounds" else "None by its account"):
        Outcome.from_json(edited(lambda told: told["results"].pop(name)), POINT)


@pytest.mark.parametrize(
    "change",
    [
        {"status": "fine"}, {"status": ["ok"]}, {"status": "failed"}, {"error": "ok, but"}, {"on_purpose": 1},
        {"status": "failed", "error": 3}, {"results": []}, {"results": None}, {"another": 1},
    ],
)  # fmt: skip
def test_a_status_that_contradicts_itself_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"expected|exactly"):
        Outcome.from_json(edited(lambda told: told.update(change)), POINT)


def test_a_result_of_another_point_is_refused() -> None:
    with pytest.raises(ValueError, match="another point"):
        Outcome.from_json(GOOD.to_json(replace(POINT, options=AlignedOptions(split_x=2, packet_width=1))), POINT)


def test_a_worker_cannot_write_a_number_that_is_none() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        replace(GOOD, results={"build_time_s": float("nan")}).to_json(POINT)


@pytest.mark.parametrize("status", ["failed", "skipped"])
def test_what_was_not_measured_needs_a_reason_and_nothing_else(status: str) -> None:
    outcome = Outcome(status, "the reason")
    assert Outcome.from_json(json.dumps({"point": POINT.configuration(), **asdict(outcome)}).encode(), POINT) == outcome


def test_an_error_that_quotes_a_path_that_is_no_text_can_be_written() -> None:
    outcome = Outcome.from_json(Outcome("failed", "no file \udcff.ply").to_json(POINT), POINT)
    assert outcome.error == "no file ?.ply"
