"""A claim's query in TOML: which rows it is about, what is judged of them, and what is refused."""

import pandas as pd
import pytest

from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, Claim, judge_claim
from experiments.results.queries import query_judge, read_claims

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
