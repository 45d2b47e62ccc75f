"""The report as a file: what it says, what it hides, how large it grows. What it does is tested in a browser."""

from __future__ import annotations

import base64
import csv
import gzip
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from atra.errors import InputError
from experiments.report import ReportContents, ReportFigure, write_report
from experiments.report.columns import views_of
from experiments.report.embedding import parquet_bytes
from experiments.report.facts import count_doubts, missing_points, scenes_in_short
from experiments.report.page import render_report
from experiments.report.pictures import EDGE_PIXELS, embed_pictures
from experiments.results.table import csv_bytes, rows_of, write_table
from experiments.workloads.frame.split_figure import draw_split_figure
from tests.report_samples import (
    CLAIMS,
    HOSTILE,
    SCENES,
    SVG,
    paper_sized_table,
    png,
    scene_pictures,
    shaded,
    small_contents,
    small_table,
)

MOST_BYTES = 950_000
APOSTROPHE, TIMES = "\N{RIGHT SINGLE QUOTATION MARK}", "\N{MULTIPLICATION SIGN}"


@pytest.fixture(scope="module")
def page() -> str:
    return render_report(small_contents())


def test_the_report_is_one_file_of_that_name(tmp_path: Path) -> None:
    assert write_report(tmp_path, small_contents()) == tmp_path / "report.html"
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_equal_contents_make_equal_pages(page: str) -> None:
    assert render_report(small_contents()) == page


class _Page(HTMLParser):
    """Collects addresses, open elements and scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.scripts: list[dict[str, str | None]] = []
        self.ids: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        fields = dict(attrs)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset", "action") and value]
        self.ids += [value for name, value in attrs if name == "id" and value]
        if tag == "script":
            self.scripts.append(fields)


def test_the_page_names_nothing_outside_itself(page: str) -> None:
    parsed = _Page(page)
    assert parsed.addresses
    assert all(address.startswith(("data:", "#")) for address in parsed.addresses)
    assert {address[1:] for address in parsed.addresses if address[0] == "#"} <= set(parsed.ids)
    assert not re.search(r"@import|url\(", page)


def test_every_id_occurs_once(page: str) -> None:
    ids = _Page(page).ids
    assert len(ids) == len(set(ids))


def test_text_from_data_never_becomes_markup() -> None:
    hostile_claim = replace(
        CLAIMS[0], **dict.fromkeys(("text", "paper_value", "how", "value", "interval", "why"), HOSTILE)
    )
    contents = small_contents(
        title=HOSTILE,
        command=HOSTILE,
        claims=(hostile_claim,),
        figures=(ReportFigure(HOSTILE, f'"{HOSTILE}', SVG),),
        pictures=(
            scene_pictures(HOSTILE, edge=8, title=HOSTILE, stands_for=HOSTILE),
            scene_pictures("b", edge=8, withheld=HOSTILE),
        ),
        environment={"cpu": HOSTILE, HOSTILE: HOSTILE},
    )
    page = render_report(contents)
    assert "<script>document" not in page
    assert "&lt;script&gt;document" in page
    types = [script.get("type") for script in _Page(page).scripts]
    assert types == ["application/json", "application/json", "text/plain", "text/plain", None]


def test_a_hostile_column_name_stays_data() -> None:
    table = small_table()
    table["</script><script id=taken>"] = pd.array(["x"] * len(table), dtype="string")
    parsed = _Page(render_report(small_contents(table=table)))
    assert "columns" in parsed.ids
    assert "taken" not in parsed.ids


def test_the_embedded_table_equals_the_files_written_beside_it(tmp_path: Path, page: str) -> None:
    write_table(tmp_path, small_table())
    for name in ("csv", "parquet"):
        packed = re.search(rf'<script type="text/plain" id="{name}">([^<]*)</script>', page)
        assert packed is not None
        assert gzip.decompress(base64.b64decode(packed[1])) == (tmp_path / f"table.{name}").read_bytes()


def test_the_files_hold_every_digit() -> None:
    table = paper_sized_table(60)
    pd.testing.assert_frame_equal(pd.read_parquet(io.BytesIO(parquet_bytes(table))), table)
    rows = list(csv.DictReader(io.StringIO(csv_bytes(table).decode())))
    for name in ("render_time_s", "plan_time_s", "speedup_low"):
        assert [float(row[name] or "nan") for row in rows] == pytest.approx(
            list(table[name].to_numpy(float)), rel=0, abs=0, nan_ok=True
        )


def test_a_report_of_the_size_of_the_paper_stays_small(tmp_path: Path) -> None:
    table = paper_sized_table(550)
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "path"}):
        draw_split_figure(rows_of(table, "horizontal")).savefig(buffer, format="svg")
    assert len(buffer.getvalue()) > 150_000
    contents = small_contents(
        table=table,
        figures=tuple(ReportFigure(f"figure{number}", "…", buffer.getvalue()) for number in range(8)),
        pictures=tuple(scene_pictures(scene, seed=seed) for seed, scene in enumerate(SCENES)),
        claims=CLAIMS * 6,
    )
    assert write_report(tmp_path, contents).stat().st_size < MOST_BYTES


@pytest.mark.parametrize("verdict", ["holds", "does not hold", "undecided", "not measured"])
def test_a_verdict_is_said_in_words(verdict: str) -> None:
    page = render_report(small_contents(claims=(replace(CLAIMS[0], verdict=verdict),)))
    (shown,) = re.findall(r'<span class="verdict [^"]*"><span aria-hidden="true">(.)</span> ([^<]*)</span>', page)
    assert shown[1] == verdict
    assert shown[0] in "✔✘≈○"


def test_an_unknown_verdict_is_refused() -> None:
    with pytest.raises(InputError, match="claim one_axis: verdict 'perhaps', expected one of holds, does not hold"):
        render_report(small_contents(claims=(replace(CLAIMS[0], verdict="perhaps"),)))


def test_a_withheld_picture_is_left_out_and_its_counts_and_reason_stay() -> None:
    shown = scene_pictures(edge=16)
    withheld = replace(shown, withheld="the licence forbids it")
    page = render_report(small_contents(pictures=(withheld,), figures=()))
    assert "data:image" not in page
    assert "the licence forbids it" in page
    assert "254 pixels equal" in page
    assert "data:image" in render_report(small_contents(pictures=(shown,), figures=()))


def test_stand_ins_are_called_stand_ins(page: str) -> None:
    assert f'material_ball</strong> is a <span class="stand-in">stand-in, not the paper{APOSTROPHE}s mitsuba' in page
    real = small_table().assign(stands_for=pd.array([None] * len(small_table()), dtype="string"))
    assert "stand-in, not" not in render_report(small_contents(table=real)).split("<script>")[0]


def test_a_scene_s_best_is_the_largest_ratio_of_its_kind() -> None:
    cornell, ball, _ = scenes_in_short(small_table())
    assert cornell.packets_vs_single is not None
    assert (cornell.packets_vs_single.ratio, cornell.packets_vs_single.low, cornell.packets_vs_single.high) == (
        20.5, 20.25, 20.75,
    )  # fmt: skip
    assert cornell.packets_vs_single.point == f"aligned, packets of 8, 2 {TIMES} 1, culling on"
    assert cornell.single is None
    assert cornell.pixels_wrong == 3
    assert ball.single is not None
    assert ball.packets is None
    assert ball.stands_for == "mitsuba"


def test_memory_and_skipped_rows_give_no_speed_up() -> None:
    table = small_table()
    assert scenes_in_short(table[table["workload"] == "memory"])[0].packets is None
    assert scenes_in_short(table[table["status"] != "ok"])[0].packets_vs_single is None


def test_a_view_holds_a_workload_s_own_columns_or_those_that_several_share() -> None:
    views = {view.name: view for view in views_of(small_table())}
    assert list(views) == ["frame", "pixels", "memory", "trust", "everything"]
    assert views["frame"].workloads == ("frame",)
    assert {"render_time_s", "speedup_low", "packets_width"} < set(views["frame"].columns)
    assert not {"render_time_q1_s", "pixels_wrong", "rss_bytes"} & set(views["frame"].columns)
    assert {"frame", "picture", "agreement", "multiframe"} == set(views["pixels"].workloads or ())
    assert views["memory"].columns[-2:] == ("peak_rss_bytes", "embree_bytes")


def test_doubts_of_a_kind_are_counted_together() -> None:
    doubts = count_doubts(small_table())
    assert (doubts.points, doubts.measured, doubts.doubtful) == (8, 6, 2)
    assert [(doubt.text, doubt.points) for doubt in doubts.kinds] == [
        ("spread is 12\N{EN DASH}31% of the median", 2),
        ("shortest sample is below 1 ms", 1),
    ]


def test_a_figure_carries_the_doubts_of_its_own_points(page: str) -> None:
    captions = re.findall(r'<p class="doubts">(.*?)</p>', page, re.S)
    assert "Doubts on 2 of 5 measured points" in " ".join(captions[0].split())
    assert "No doubts on any of its 1 measured points" in " ".join(captions[1].split())


def test_missing_points_are_listed_with_their_reasons(page: str) -> None:
    skipped, failed = missing_points(small_table())
    assert (skipped.status, skipped.reason) == ("skipped", "needs 9.5 GiB, the budget is 4 GiB")
    assert skipped.points == (f"frame: aligned, packets of 8, 16 {TIMES} 1, culling on",)
    assert failed.scene == HOSTILE
    assert "needs 9.5 GiB, the budget is 4 GiB" in page


def test_reasons_that_differ_in_numbers_alone_are_one() -> None:
    table = small_table()
    skipped = table[table["status"] == "skipped"]
    more = pd.concat(
        [skipped, skipped.assign(error="needs 11 GiB, the budget is 4 GiB", split_x=32)], ignore_index=True
    )
    assert [len(group.points) for group in missing_points(more)] == [2]


def test_an_empty_table_still_makes_a_page() -> None:
    page = render_report(small_contents(table=small_table().iloc[:0], figures=(), pictures=(), claims=()))
    assert "No frame times were measured" in page


def _decoded(uri: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))))


@pytest.mark.parametrize("edge", [100, 640, 1024, 1100])
def test_each_differing_pixel_keeps_a_whole_pixel(edge: int) -> None:
    images = embed_pictures(scene_pictures(edge=edge))
    assert images is not None
    assert images.shown_width == min(edge, EDGE_PIXELS)
    marked = (_decoded(images.difference)[..., :3] == (255, 170, 0)).all(axis=2)
    assert marked.sum() == 2
    assert marked[edge // 8 * images.shown_height // edge, edge // 4 * images.shown_width // edge]


def test_the_overlay_turns_the_aligned_picture_into_the_per_pixel_picture() -> None:
    pictures = scene_pictures(edge=64)
    images = embed_pictures(pictures)
    assert images is not None
    assert not images.lossy
    laid_over = _decoded(images.aligned)[..., :3].copy()
    overlay = _decoded(images.overlay)
    shown = overlay[..., 3] > 0
    laid_over[shown] = overlay[shown][:, :3]
    assert pictures.pixel is not None
    assert (laid_over == np.asarray(Image.open(io.BytesIO(pictures.pixel)))).all()
    assert shown.sum() == 2


def test_a_tie_that_shading_does_not_show_is_marked_all_the_same() -> None:
    plain = scene_pictures(edge=64)
    images = embed_pictures(replace(plain, pixel=plain.aligned))
    assert images is not None
    assert (_decoded(images.difference)[..., :3] == (255, 170, 0)).all(axis=2).sum() == 2


def test_a_tone_that_differs_where_the_hits_are_equal_is_not_marked() -> None:
    blank = png(np.full((64, 64, 3), 255, np.uint8))
    images = embed_pictures(replace(scene_pictures(edge=64), difference=blank))
    assert images is not None
    assert (_decoded(images.difference) == 255).all()


def test_pictures_of_unequal_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="cornell_box measure 32 x 32, 16 x 16, 32 x 32"):
        embed_pictures(replace(scene_pictures(edge=32), pixel=png(shaded(16))))


@pytest.mark.parametrize("content", [b"", b"<p>no figure</p>", b"\x89PNG\r\n\x1a\nbroken"])
def test_a_figure_that_is_no_image_is_refused(content: bytes) -> None:
    contents: ReportContents = small_contents(figures=(ReportFigure("figure5", "", content),))
    with pytest.raises(InputError, match="figure5"):
        render_report(contents)
