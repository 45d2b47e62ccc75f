"""The one rule of verdict, a claim's query in TOML, and what is kept of them."""

import json

import pandas as pd
import pytest

from experiments.documents.writing import folders, recomputed
from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    NOT_MEASURED,
    UNDECIDED,
    Claim,
    judge_claim,
)
from experiments.results.intervals import with_intervals
from experiments.results.queries import query_judge, read_claims
from experiments.results.statistics import Estimate, Interval, NotMeasuredError, Pool
from experiments.results.table import frame_of
from experiments.results.verdicts import Bounds, Outcome, exact, known_values, on_cases, ratio_of, value_judge

POINTS = (("box", "a", 1, 2.0), ("box", "b", 8, 0.5), ("hall", "a", 4, 3.0))
ROWS = [
    {
        "scene": scene,
        "point_id": f"{scene} {kind}",
        "kind": kind,
        "size": size,
        "gain": gain * by,
        "cost": 2 * gain * by,
    }
    for scene, kind, size, gain in POINTS
    for by in (0.99, 1.0, 1.01)
]
TABLE = pd.DataFrame(ROWS).assign(status="ok")


def verdict(**query):
    (judged,) = judge_claim(Claim("one", "", "", "", "", {"": query_judge(query)}), TABLE)
    return judged.verdict


@pytest.mark.parametrize(("query", "expected"), [
    ({"column": "gain", "at_least": 1}, DOES_NOT_HOLD),
    ({"column": "gain", "at_least": 1, "where": {"kind": "a"}}, HOLDS),
    ({"column": "gain", "at_most": 1, "where": {"kind": {"not": "a"}}}, HOLDS),
    ({"column": "gain", "at_least": 1, "where": {"scene": ["hall", "court"]}}, HOLDS),
    ({"column": "gain", "at_least": 1, "where": {"size": {"at_least": 4}}}, DOES_NOT_HOLD),
    ({"column": "gain", "at_least": 1, "where": {"size": {"at_most": 4}}}, HOLDS),
    ({"column": "gain", "at_least": 1, "where": {"size": {"below": 1}}}, NOT_MEASURED),
    ({"column": "gain", "at_least": 1, "where": {"speedup": {"known": True}}}, NOT_MEASURED),
    ({"column": "gain", "at_most": 1, "where": {"kind": "b", "speedup": {"not": 2.0}}}, HOLDS),
    ({"column": "gain", "at_least": 1, "least": "size"}, HOLDS),
    ({"column": "gain", "at_least": 2.5}, DOES_NOT_HOLD),
    ({"column": "gain", "at_least": 2.5, "some": True}, HOLDS),
    ({"column": "gain", "over": "cost", "at_least": 0.49, "at_most": 0.51, "counted": True}, HOLDS),
])  # fmt: skip
def test_a_query_is_about_the_rows_that_it_names_and_judges_what_it_names(query, expected):
    assert verdict(**query) == expected


@pytest.mark.parametrize("query", [
    {"column": "gain", "where": {"weight": {"not": 1}}}, {"column": "weight"}, {"column": "gain", "least": "weight"},
])  # fmt: skip
def test_a_column_that_no_table_has_is_refused_with_the_name_of_the_claim(query):
    with pytest.raises(ValueError, match="claim one cannot be judged: weight is a column of no table"):
        verdict(**query)


def test_a_claim_that_no_table_can_judge_says_why():
    (judged,) = judge_claim(Claim("one", "", "", "", "", {"": query_judge("there is no GPU")}), TABLE)
    assert (judged.verdict, judged.why) == (NOT_MEASURED, "there is no GPU")


def test_a_key_that_no_query_has_is_refused_by_name():
    with pytest.raises(ValueError, match=r"a judge has \['most'\], expected some of \['at_least'"):
        query_judge({"column": "gain", "most": 1})


def test_a_claim_without_a_judge_is_refused(tmp_path):
    path = tmp_path / "claims.toml"
    path.write_text("[words]\n[[claims]]\nid = 'one'\nsection = ''\ntext = ''\npaper = ''\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"leaves the claims \['one'\] to functions, expected \[\]"):
        read_claims(path, {})


YES, NO, OPEN, NONE = Outcome(True, "1"), Outcome(False, "1", None, "no"), Outcome(None, "1", None, "?"), Outcome(None)


@pytest.mark.parametrize(("known", "decided"), [
    (Interval(1.1, 1.0, 1.2), True), (Interval(1.1, 0.9, 1.2), None), (Interval(0.8, 0.7, 0.9), False),
    (Interval(1.9, 1.7, 2.1), None), (Interval(2.5, 2.2, 2.9), False), (2.0, True), (2.01, False),
])  # fmt: skip
def test_a_number_is_inside_its_bounds_by_its_whole_interval(known, decided):
    assert Bounds(1.0, 2.0).decide(known) is decided


@pytest.mark.parametrize(("outcomes", "every", "some"), [
    ((YES, YES), HOLDS, HOLDS), ((YES, NO, NONE), DOES_NOT_HOLD, HOLDS), ((YES, OPEN, NONE), NOT_MEASURED, HOLDS),
    ((YES, OPEN), UNDECIDED, HOLDS), ((NO, OPEN), DOES_NOT_HOLD, UNDECIDED), ((NO, NO), DOES_NOT_HOLD, DOES_NOT_HOLD),
])  # fmt: skip
def test_one_case_refutes_what_is_said_of_all_and_confirms_what_is_said_of_some(outcomes, every, some):
    cases = [(f"scene {number}", outcome) for number, outcome in enumerate(outcomes)]
    assert (on_cases(cases).verdict, on_cases(cases, every=False).verdict) == (every, some)
    with pytest.raises(NotMeasuredError):
        on_cases([])


def rows(**values):
    """A row a process: point -> its values of `ratio`."""
    return frame_of([
        {"scene": name, "workload": "frame", "method": "aligned", "status": "ok", "point_id": name, "process": number,
         "speedup": value}
        for name, several in values.items() for number, value in enumerate(several)
    ])  # fmt: skip


def test_few_processes_borrow_the_variance_of_the_other_points():
    table = rows(many=[1.0, 1.1, 1.2], few=[2.0])
    known = known_values(table, table["speedup"])
    pool = Pool.of([[1.0, 1.1, 1.2], [2.0]])
    assert known["few"] == Estimate.of([2.0], pool)
    assert (known["few"].freedom, known["few"].variance) == (2, pytest.approx(pool.variance))
    assert known_values(rows(few=[2.0]), [2.0]) == {}
    assert known_values(rows(alike=[2.0, 2.0]), [2.0, 2.0]) == {"alike": 2.0}
    assert ratio_of(4.0, exact(2.0)).value == pytest.approx(2)


def test_a_judge_reads_processes_and_one_point_of_a_scene_refutes():
    judge = value_judge(lambda rows: rows["speedup"], lambda rows: rows["speedup"].notna(), Bounds(low=1.0))
    assert judge(rows(a=[1.2, 1.21, 1.22], b=[1.3, 1.31, 1.32])).verdict == HOLDS
    assert judge(rows(a=[1.2, 1.21, 1.22], b=[0.8, 0.81, 0.82])).verdict == DOES_NOT_HOLD
    assert judge(rows(a=[1.2, 1.21, 1.22], b=[0.5, 1.0, 2.0])).verdict == UNDECIDED


def test_a_table_has_an_interval_of_every_value_and_tells_what_reports_the_best():
    processes = rows(many=[1.0, 1.1, 1.2], few=[2.0])
    points = processes.drop_duplicates("point_id")
    told = with_intervals(
        points.assign(speedup=[1.1, 2.0], speedup_low=[1.0, None], speedup_high=[1.2, None]), processes
    )
    many, few = (told.iloc[place] for place in range(2))
    assert (many["speedup_low"], many["speedup_high"]) == (1.0, 1.2)
    assert few["speedup_low"] < 2.0 < few["speedup_high"]
    assert many["speedup_rest"] == pytest.approx((1.1 * 1.2) ** 0.5)


@pytest.mark.parametrize("folder", folders(), ids=lambda path: path.name)
def test_every_verdict_that_is_kept_is_that_of_the_rule(folder):
    path = folder / "claims.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    assert kept == recomputed(folder)
