"""The report in a real browser, opened from a file; skipped, with the reason, where there is no browser."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from experiments.report import write_report
from experiments.results.table import columns, write_table
from tests.report_samples import HOSTILE, small_contents, small_table

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed: pip install -e '.[test]'")

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


@dataclass
class Opened:
    """A page with what it complained of and what it asked for."""

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    write_report(folder, small_contents())
    write_table(folder, small_table())
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        found = next(filter(None, map(shutil.which, _BROWSERS)), None)
        try:
            # Containers often lack what Chromium's sandbox needs; the page is our own.
            started = driver.chromium.launch(executable_path=found, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no Chromium could be started: {str(error).splitlines()[0]}")
        yield started
        started.close()


@pytest.fixture
def opened(browser: Any, folder: Path) -> Iterator[Opened]:
    with browser.new_context(viewport=DESKTOP) as context:
        yield _open(context, folder)


def _open(context: Any, folder: Path) -> Opened:
    opened = Opened(context.new_page())
    opened.page.on("console", lambda message: opened.complaints.append(f"{message.type}: {message.text}"))
    opened.page.on("pageerror", lambda error: opened.complaints.append(str(error)))
    opened.page.on("request", lambda request: opened.requests.append(request.url))
    opened.page.goto((folder / "report.html").as_uri())
    opened.page.wait_for_selector("html[data-ready]")
    return opened


def _column(page: Any, name: str) -> list[str]:
    """Texts of a column of the whole table, from top to bottom."""
    place = page.eval_on_selector_all("#points thead th", "all => all.map(one => one.dataset.column)").index(name)
    return [row[place] for row in page.eval_on_selector_all(
        "#points tbody tr", "all => all.map(row => [...row.cells].map(cell => cell.innerText))"
    )]  # fmt: skip


def _click_heading(page: Any, name: str) -> None:
    page.click(f"#points th[data-column={name}] button")


def test_it_opens_without_complaint_and_without_asking_for_anything(opened: Opened, folder: Path) -> None:
    opened.page.mouse.wheel(0, 100_000)
    assert opened.complaints == []
    # What the page makes of itself is no request to anyone.
    asked = [url for url in opened.requests if not url.startswith(("data:", "blob:"))]
    assert asked == [(folder / "report.html").as_uri()]
    assert opened.page.is_hidden("#trouble")


def test_hostile_text_is_shown_and_not_run(opened: Opened) -> None:
    assert opened.page.title() == "The paper on this machine"
    opened.page.select_option("#view", label="trust")
    assert HOSTILE in _column(opened.page, "scene")
    assert any(HOSTILE in error for error in _column(opened.page, "error"))
    assert HOSTILE in opened.page.inner_text("#missing")


def test_figures_and_pictures_are_really_drawn(opened: Opened) -> None:
    opened.page.wait_for_function("[...document.images].every(image => image.complete)")
    widths = opened.page.eval_on_selector_all("img", "all => all.map(image => image.naturalWidth)")
    assert len(widths) == 5
    assert all(width > 0 for width in widths)


@pytest.mark.parametrize("viewport", [PHONE, DESKTOP], ids=["phone", "desktop"])
def test_the_page_never_scrolls_sideways(browser: Any, folder: Path, viewport: dict[str, int]) -> None:
    with browser.new_context(viewport=viewport) as context:
        page = _open(context, folder).page
        page.eval_on_selector_all("details", "all => all.forEach(one => one.open = true)")
        page.click(".enlarge >> nth=0")
        for view in ("frame", "everything"):
            page.select_option("#view", label=view)
            assert page.evaluate("document.documentElement.scrollWidth") == viewport["width"]


def test_a_heading_sorts_by_value_both_ways_and_missing_values_come_last(opened: Opened) -> None:
    page = opened.page
    page.select_option("#view", label="everything")
    _click_heading(page, "render_time_s")
    shown = _column(page, "render_time_s")
    numbers = [float(text) for text in shown if text]
    # 9 ms before 20 and 100: by value, not by text.
    assert numbers == sorted(numbers)
    assert numbers[0] == 9
    assert numbers[-1] > 100 - 1e-9
    assert shown[len(numbers) :] == [""] * 3
    assert page.get_attribute("#points th[data-column=render_time_s]", "aria-sort") == "ascending"
    _click_heading(page, "render_time_s")
    assert [float(text) for text in _column(page, "render_time_s")[: len(numbers)]] == numbers[::-1]
    assert page.get_attribute("#points th[data-column=render_time_s]", "aria-sort") == "descending"
    _click_heading(page, "scene")
    assert page.get_attribute("#points th[data-column=render_time_s]", "aria-sort") is None


def test_the_keyboard_sorts_too(opened: Opened) -> None:
    opened.page.focus("#points th[data-column=split_x] button")
    opened.page.keyboard.press("Enter")
    splits = [int(text) for text in _column(opened.page, "split_x")]
    assert splits == sorted(splits)
    assert len(set(splits)) > 1


def test_the_filter_keeps_rows_with_all_words_and_values(opened: Opened) -> None:
    page = opened.page
    page.select_option("#view", label="everything")
    page.fill("#filter", "CORNELL skipped")
    assert _column(page, "split_x") == ["16"]
    page.fill("#filter", "split_x=1")
    assert set(_column(page, "split_x")) == {"1"}
    page.fill("#filter", "scene=cornell_box workload=frame status=ok")
    assert len(_column(page, "scene")) == 4
    assert page.inner_text("#shown").startswith("4 of 8 rows")
    page.fill("#filter", "nothing like it")
    assert _column(page, "scene") == []
    page.fill("#filter", "")
    assert len(_column(page, "scene")) == 8


def test_a_view_says_how_many_rows_it_leaves_out(opened: Opened) -> None:
    page = opened.page
    page.select_option("#view", label="frame")
    assert page.inner_text("#shown") == "7 of 8 rows; 1 more of other workloads"
    page.select_option("#view", label="memory")
    assert set(_column(page, "workload")) == {"frame", "memory"}


def test_a_number_too_small_for_its_decimals_is_not_shown_as_zero(opened: Opened) -> None:
    opened.page.select_option("#view", label="frame")
    shown = _column(opened.page, "plan_time_s")
    assert "1.5e-4" in shown
    assert "0.00" not in shown


def test_a_row_of_a_stand_in_says_so(opened: Opened) -> None:
    opened.page.fill("#filter", "stand-in")
    (scene,) = _column(opened.page, "scene")
    assert scene.split("\n") == ["material_ball", "stand-in, not the paper\N{RIGHT SINGLE QUOTATION MARK}s mitsuba"]


def _shown_share(page: Any) -> float:
    """Where the line between the two pictures stands, from 0 (left) to 1."""
    return float(page.evaluate(
        """() => {
          const frame = document.querySelector(".compare").getBoundingClientRect();
          const line = document.querySelector(".compare .line").getBoundingClientRect();
          return (line.left + line.width / 2 - frame.left) / frame.width;
        }"""
    ))  # fmt: skip


def test_the_slider_follows_the_mouse_and_the_keyboard(opened: Opened) -> None:
    page = opened.page
    slider = page.locator(".compare input").first
    slider.scroll_into_view_if_needed()
    assert _shown_share(page) == pytest.approx(0.5, abs=0.01)
    frame = slider.bounding_box()
    middle = frame["y"] + frame["height"] / 2
    page.mouse.move(frame["x"] + frame["width"] * 0.5, middle)
    page.mouse.down()
    page.mouse.move(frame["x"] + frame["width"] * 0.8, middle, steps=5)
    page.mouse.up()
    assert _shown_share(page) == pytest.approx(0.8, abs=0.03)
    clipped = page.eval_on_selector(".compare .pixel", "image => getComputedStyle(image).clipPath")
    slider.focus()
    page.keyboard.press("Home")
    assert _shown_share(page) == pytest.approx(0, abs=0.01)
    assert page.eval_on_selector(".compare .pixel", "image => getComputedStyle(image).clipPath") != clipped
    page.keyboard.press("ArrowRight")
    assert _shown_share(page) == pytest.approx(0.01, abs=0.005)


def _download(page: Any, kind: str) -> bytes:
    with page.expect_download() as download:
        page.click(f"[data-download={kind}]")
    assert download.value.suggested_filename == f"table.{kind}"
    return Path(download.value.path()).read_bytes()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_download_is_the_file_written_beside_the_report(opened: Opened, folder: Path, kind: str) -> None:
    opened.page.fill("#filter", "skipped")  # the download is the whole table all the same
    assert _download(opened.page, kind) == (folder / f"table.{kind}").read_bytes()


def test_the_json_download_holds_every_value(opened: Opened) -> None:
    rows = json.loads(_download(opened.page, "json"))
    table = small_table()
    assert [list(row) for row in rows] == [list(columns())] * len(table)
    read = {name: pd.array([row[name] for row in rows], dtype=column.dtype) for name, column in columns().items()}
    pd.testing.assert_frame_equal(pd.DataFrame(read), table, check_exact=True)


def _luminance(page: Any, selector: str, field: str) -> float:
    text = page.eval_on_selector(selector, f"one => getComputedStyle(one).{field}")
    return sum(float(part) for part in text[text.index("(") + 1 : -1].split(",")[:3]) / 3


def test_the_page_is_light_or_dark_as_the_reader_prefers(browser: Any, folder: Path) -> None:
    for scheme, background_is_light in (("light", True), ("dark", False)):
        with browser.new_context(viewport=DESKTOP, color_scheme=scheme) as context:
            page = _open(context, folder).page
            background, ink = (_luminance(page, "body", field) for field in ("backgroundColor", "color"))
            assert (background > 200) == background_is_light
            assert abs(background - ink) > 150
            # Figures are drawn in dark ink: their sheet stays white.
            assert _luminance(page, ".sheet", "backgroundColor") == 255


def test_paper_shows_no_controls_and_is_white_even_from_a_dark_screen(browser: Any, folder: Path) -> None:
    with browser.new_context(viewport=DESKTOP, color_scheme="dark") as context:
        page = _open(context, folder).page
        for selector in ("nav", ".controls", ".enlarge", ".compare input"):
            assert page.is_visible(selector), selector
        page.emulate_media(media="print")
        for selector in ("nav", ".controls", ".enlarge", ".compare input"):
            assert page.is_hidden(selector), selector
        assert _luminance(page, "body", "backgroundColor") == 255
        assert page.is_visible("#points tbody tr")


def test_what_is_folded_away_is_unfolded_on_paper_and_folded_again(opened: Opened) -> None:
    page = opened.page
    count = "document.querySelectorAll('details[open]').length"
    assert page.evaluate(count) == 0
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(count) == page.evaluate("document.querySelectorAll('details').length") > 0
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(count) == 0


def test_without_javascript_the_page_says_what_is_missing(browser: Any, folder: Path) -> None:
    with browser.new_context(viewport=DESKTOP, java_script_enabled=False) as context:
        page = context.new_page()
        page.goto((folder / "report.html").as_uri())
        text = page.inner_text("body")
        assert "need JavaScript" in text
        assert "does not hold" in text
