"""The report in a real browser, opened from a file; skipped, with the reason, where there is no browser."""

from pathlib import Path

import pytest

from experiments.drawing.style import PANEL_INCHES, SMALL
from experiments.report import write_report
from experiments.report.writing import figures_of
from tests.browser import chromium
from tests.drawn import make_rows, time_row
from tests.report_samples import HOSTILE, small_contents

pytestmark = pytest.mark.slow


PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    return write_report(tmp_path_factory.mktemp("report"), small_contents()).as_uri()


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture
def page(browser):
    """An empty one, on a desktop."""
    with browser.new_context(viewport=DESKTOP) as context:
        yield context.new_page()


def _unfold(page):
    page.eval_on_selector_all("details", "all => all.forEach(one => one.open = true)")


def test_it_opens_without_complaint_asks_for_nothing_and_draws_its_figures_and_pictures(page, address):
    complaints, requests = [], []
    page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    assert complaints == []
    assert [url for url in requests if not url.startswith("data:")] == [address]
    widths = page.eval_on_selector_all("img", "all => all.map(image => image.naturalWidth)")
    assert len(widths) == 5
    assert all(width > 0 for width in widths)


def test_hostile_text_is_shown_and_not_run_and_neither_would_a_script_that_got_into_the_page(page, address):
    page.goto(address)
    assert page.title() == "The paper on this machine"
    assert HOSTILE in page.inner_text("#missing")
    path = Path(address.removeprefix("file://"))
    path.with_name("broken.html").write_text(path.read_text(encoding="utf-8") + HOSTILE, encoding="utf-8")
    page.goto(address.replace("report.html", "broken.html"))
    assert page.title() == "The paper on this machine"


@pytest.mark.parametrize("width", [400, 800, 1280])
def test_text_of_a_figure_is_at_least_9_px_on_any_page(page, tmp_path, width):
    table = make_rows(*(time_row(split, 0.01, scene=scene) for scene in "ab" for split in (1, 2)))
    figures = list(figures_of(table, tmp_path))
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(write_report(tmp_path, small_contents(table=table, figures=figures)).as_uri())
    shown = page.locator(".sheet img").first.bounding_box()["width"]
    assert SMALL * shown / (72 * PANEL_INCHES * 2) >= 9


@pytest.mark.parametrize("viewport", [PHONE, DESKTOP], ids=["phone", "desktop"])
def test_the_page_never_scrolls_sideways(page, address, viewport):
    page.set_viewport_size(viewport)
    page.goto(address)
    _unfold(page)
    assert page.evaluate("document.documentElement.scrollWidth") == viewport["width"]
    wide = page.eval_on_selector_all(".scroll", "all => all.map(one => one.scrollWidth > one.clientWidth)")
    assert wide[0], "the table is narrow, so this shows nothing"


def test_a_table_unfolds_and_its_scene_stays_in_sight_when_it_is_scrolled(page, address):
    page.set_viewport_size(PHONE)
    page.goto(address)
    scene = page.locator("#tables tbody th", has_text="material_ball")
    assert not scene.is_visible()
    page.click("#tables summary >> nth=0")
    assert scene.is_visible()
    before = scene.bounding_box()["x"]
    page.eval_on_selector("#tables .scroll", "one => one.scrollLeft = 500")
    assert scene.bounding_box()["x"] == pytest.approx(before, abs=1)


@pytest.mark.parametrize("width", [400, 1280])
def test_the_figures_of_the_printed_page_are_there_before_anyone_prints(page, address, width):
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(address)
    there = page.evaluate(
        "[...document.images].filter(one => one.complete && one.naturalWidth).map(one => one.currentSrc)"
    )
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 690, "height": 980})  # a sheet of A4 between its margins
    for sheet in page.locator(".sheet").all():
        (shown,) = sheet.locator("img >> visible=true").all()
        assert shown.evaluate("one => one.currentSrc") in there


def _brightness(page, selector, field):
    text = page.eval_on_selector(selector, f"one => getComputedStyle(one).{field}")
    return sum(float(part) for part in text[text.index("(") + 1 : -1].split(",")[:3]) / 3


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_light_or_dark_as_the_reader_prefers(page, address, scheme):
    page.emulate_media(color_scheme=scheme)
    page.goto(address)
    background, ink, cell = (
        _brightness(page, selector, field)
        for selector, field in (("body", "backgroundColor"), ("body", "color"), ("#tables td", "color"))
    )
    assert (background > 200) == (scheme == "light")
    assert min(abs(background - ink), abs(background - cell)) > 150
    # Figures are drawn in dark ink: their sheet stays white.
    assert _brightness(page, ".sheet", "backgroundColor") == 255


def test_paper_is_white_even_from_a_dark_screen_unfolded_and_without_the_wide_tables(page, address):
    page.emulate_media(color_scheme="dark", media="print")
    page.goto(address)
    assert page.is_hidden("nav")
    assert page.is_hidden("#tables")
    assert _brightness(page, "body", "backgroundColor") == 255
    assert page.is_visible("#claims details p >> nth=0")
