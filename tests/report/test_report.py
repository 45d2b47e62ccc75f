"""The report as a file: what it says, and what it hides. How it looks is tested in a browser."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pandas as pd
import pytest

from experiments.paper.claims import judge_claims
from experiments.report import write_report
from experiments.report.facts import count_warnings, missing_points, workload_tables
from experiments.report.load_figure import load_figure
from experiments.report.page import render_report
from experiments.results.claims import NOT_MEASURED
from experiments.results.processes import BAND
from tests.paper_table import agreeing_table, scaled
from tests.report_samples import CLAIMS, HOSTILE, contents_that_say, scene_pictures, small_contents, small_table

APOSTROPHE, TIMES = "\N{RIGHT SINGLE QUOTATION MARK}", "\N{MULTIPLICATION SIGN}"


@pytest.fixture(scope="module")
def page():
    return render_report(small_contents())


@pytest.fixture(scope="module")
def full_page():
    """The page of all four scenes, which agree with the paper but for single rays of one: half as fast, gathering or
    not."""
    processes = scaled(agreeing_table(), 0.5, workload="frame", packet_width=1, scene="sponza")
    points = processes[processes["process"].fillna(0) == 0]
    return render_report(small_contents(table=points, processes=processes, claims=judge_claims(processes)))


def test_the_page_shows_when_each_process_measured_and_how_busy_the_machine_was(page):
    said = 'alt="load: When each process measured, and the part of the cores that others took meanwhile."'
    assert said not in page
    processes = small_table().assign(others_share=[0.0, 0.5, *[None] * 6], stolen_share=0.25)
    assert render_report(small_contents(processes=processes)).count(said) == 1
    shown = load_figure(processes)
    assert shown.point_ids == set(processes["point_id"][:2])  # those that tell


class _Page(HTMLParser):
    """Collects tags, addresses, and ids."""

    def __init__(self, text):
        super().__init__()
        self.tags = set()
        self.addresses = []
        self.ids = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset", "action") and value]
        self.ids += [value for name, value in attrs if name == "id" and value]


def test_the_report_is_one_file_and_equal_contents_make_equal_ones(tmp_path, page):
    assert write_report(tmp_path, small_contents()) == tmp_path / "report.html"
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page


def test_the_page_names_nothing_outside_itself_but_the_tables_beside_it(page):
    parsed = _Page(page)
    inside = {address[1:] for address in parsed.addresses if address[0] == "#"}
    assert {"figures", "claims", "pictures", "missing", "tables"} <= inside <= set(parsed.ids)
    outside = [address for address in parsed.addresses if not address.startswith(("data:", "#"))]
    assert outside == ["table.csv", "table.parquet"]
    assert not re.search(r"@import|url\(", page)
    assert len(parsed.ids) == len(set(parsed.ids))


def test_text_from_data_never_becomes_markup():
    page = render_report(contents_that_say(HOSTILE))
    assert "script" not in _Page(page).tags
    assert page.count("&lt;script&gt;document") > 30


@pytest.mark.parametrize("verdict", ["holds", "does not hold", "undecided", "not measured"])
def test_a_verdict_is_said_in_words(verdict):
    page = render_report(small_contents(claims=(replace(CLAIMS[0], verdict=verdict), CLAIMS[1])))
    shown, _ = re.findall(r'<span class="verdict [^"]*"><span aria-hidden="true">(.)</span> ([^<]*)</span>', page)
    assert shown[1] == verdict
    assert shown[0] in "✔✘≈○"


def test_a_picture_that_must_not_be_passed_on_is_left_out_and_its_counts_and_the_reason_stay():
    shown, withheld, equal = (
        render_report(small_contents(pictures=(pictures,), figures=()))
        for pictures in (scene_pictures(), scene_pictures("mitsuba"), scene_pictures(pixels_equal=256, pixels_tied=0))
    )
    assert shown.count("data:image/png") == 3
    assert equal.count("data:image/png") == 2  # no empty one shows their difference
    assert "data:image" not in withheld
    assert "does not allow pictures of it to be passed on" in withheld
    assert "254 pixels equal" in withheld


def test_stand_ins_are_called_stand_ins_wherever_their_numbers_stand(page):
    said = f"stand-in, not the paper{APOSTROPHE}s mitsuba"
    assert f'material_ball</strong> is a <span class="stand-in">{said}' in page
    assert len(re.findall(rf"<th[^>]*>material_ball\b.*?{said}", page)) == 1
    real = small_table().assign(stands_for=pd.array([None] * len(small_table()), dtype="string"))
    assert "stand-in, not" not in render_report(small_contents(table=real))


def test_the_page_begins_with_the_conclusion_and_shows_the_paper_s_number_beside_ours_under_both_readings(full_page):
    assert re.search(rf"</h1>\s*<p class=.conclusion.>The paper{APOSTROPHE}s best speed-ups", full_page)
    first, ours, *_ = re.findall(r"<table.*?</table>", full_page, re.S)
    (sponza,) = re.findall(r"<th[^>]*>sponza.*?</tr>", first, re.S)
    assert re.findall(rf"<strong>([^<]*){TIMES}</strong>", sponza) == ["1.71", "0.88", "1.75"]
    assert "no claim of the paper" in ours
    assert ours.count(f"1,024 {TIMES} 1, packets of 8") == 12


def test_readings_that_part_are_seen_at_a_glance_and_an_inference_is_called_one(full_page):
    (best,) = re.findall(r'<tbody[^>]*id="claim-best-speedup-sponza">.*?</tbody>', full_page, re.S)
    verdicts = re.findall(r'<span class="verdict [^"]*"><span aria-hidden="true">.</span> ([^<]*)</span>', best)
    assert verdicts == ["holds under one reading only", "does not hold", "holds"]
    assert re.findall(r'<span class="reading">([^<]*)</span>', best) == ["nearest hit", "all hits"]
    (inferred,) = re.findall(r'<tbody[^>]*id="claim-larger-scenes-gain-less">.*?</tbody>', full_page, re.S)
    assert inferred.count("An inference from the paper") == 1
    assert full_page.count("An inference from the paper") == 2
    said = "Of 29 claims, inferences not counted: holds 21, holds under one reading only 4, does not hold 1"
    assert said in full_page


def test_the_page_says_how_many_processes_were_left_out_and_how_busy_the_machine_was():
    table = small_table().assign(processes=5, processes_left_out=0, load_average=0.25)
    table.loc[0, ["processes", "processes_left_out", "load_average"]] = [3, 2, 1.75]
    page = render_report(small_contents(table=table, processes=table))
    assert "<b>2 of 30</b> processes left out, of 1 point: rtcIntersect1 over packets, where they take" in page
    assert f"is over {BAND * 100:.0f} % off its median" in page
    assert "0.2 to 1.8 before a process" in page
    assert "nothing else" not in page
    for most, said in ((0.03, "nothing else was running: others took 1.0% to 3.0%"), (0.2, "<dd>others took 1.0% to")):
        table = small_table().assign(load_average=0.1, others_share=0.01, stolen_share=pd.NA)
        table.loc[0, "stolen_share"] = most - 0.01
        page = render_report(small_contents(table=table, processes=table))
        assert said in page
        assert "of its cores while it measured" in page


def column(table, name):
    """Text and interval of each cell of a column."""
    (place,) = [place for place, heading in enumerate(table.headings) if heading.name == name]
    return [cells[place] for cells, _ in table.rows]


def test_a_table_holds_the_measured_points_of_its_workload_in_units_people_read(page):
    frame, memory = workload_tables(small_table())
    assert (frame.workload, memory.workload) == ("frame", "memory")
    assert column(frame, "split_x") == [("1", ""), ("2", ""), ("4", ""), ("8", ""), ("2", "")]
    assert column(frame, "culling")[0] == ("yes", "")
    assert column(frame, "triangles_traced")[0] == ("1,234,567", "")
    assert column(frame, "plan_time_s")[2] == ("1.5e-04", "")  # too small for its decimals
    assert column(frame, "render_time_s")[1] == ("9.00", "[8.55, 9.54]")
    assert column(frame, "speedup")[1] == ("20.50", "[20.25, 20.75]")
    assert column(memory, "rss_bytes") == [("1,024.00", "")]
    units = {heading.name: (heading.text, heading.unit) for heading in frame.headings}
    assert units["render_time_s"] == ("render time", "ms")
    assert units["rss_bytes"] == ("rss", "MiB")
    assert not {"render_time_low_s", "embree_bytes", "point_id"} & set(units)  # ends of intervals, or without a value
    assert list(units).index("speedup") < list(units).index("rss_bytes")
    assert "warnings" in units
    assert "render_time_s" not in [heading.name for heading in memory.headings]
    assert re.search(r'<td class="number">9\.00 <small>\[8\.55, 9\.54\]</small></td>', page)


def test_warnings_of_a_kind_are_counted_together():
    warnings = count_warnings(small_table())
    assert (warnings.points, warnings.measured, warnings.flagged) == (8, 6, 2)
    assert [(warning.text, warning.points) for warning in warnings.kinds] == [
        ("spread is 12\N{EN DASH}31% of the median", 2),
        ("shortest sample is below 1 ms", 1),
    ]


def test_over_every_figure_stands_what_it_shows_and_beside_it_its_notes_and_the_warnings_of_its_points(page):
    figures = re.findall(r'<h3 id="figure-\d">(.*?)</h3>.*?<details class="beside">(.*?)</details>', page, re.S)
    assert [title for title, _ in figures] == ["Frame time over horizontal splits.", "Memory over horizontal splits."]
    for name, (_, beside) in zip(("figure5", "figure7"), figures, strict=True):
        assert "three processes" in beside
        assert beside.count(f"a note on {name}") == 2
    own, none = (" ".join(text.split()) for text in re.findall(r'<p class="warnings">(.*?)</p>', page, re.S))
    assert "Warnings on 2 of 5 measured points" in own
    assert "No warnings on any of its 1 measured points" in none
    assert f"neither a tie nor a ray at a triangle{APOSTROPHE}s edge excuses" in page  # a wrong pixel


def test_missing_points_are_listed_with_their_reasons_and_those_that_differ_in_numbers_alone_are_one(page):
    skipped, failed = missing_points(small_table())
    assert (skipped.status, skipped.reason) == ("skipped", "needs 9.5 GiB, the budget is 4 GiB")
    assert skipped.points == (f"frame: aligned, packets of 8, 16 {TIMES} 1, culling on",)
    assert failed.scene == HOSTILE
    assert "needs 9.5 GiB, the budget is 4 GiB" in page
    row = small_table().query("status == 'skipped'")
    more = pd.concat([row, row.assign(error="needs 11 GiB, the budget is 4 GiB", split_x=32)], ignore_index=True)
    assert [len(group.points) for group in missing_points(more)] == [2]


def test_a_page_on_which_no_claim_was_judged_speaks_of_none_and_an_empty_table_still_makes_one():
    unjudged = tuple(replace(one, verdict=NOT_MEASURED) for one in CLAIMS)
    page = render_report(small_contents(claims=unjudged))
    assert "claims of the paper hold" not in page
    assert 'id="claims"' not in page
    assert 'href="#claims"' not in page
    assert 'class="conclusion"' not in page
    empty = small_table().iloc[:0]
    page = render_report(small_contents(table=empty, processes=empty, figures=(), pictures=(), claims=()))
    assert "No best speed-up can be told: the table is empty." in page
    assert "No point was measured." in page
