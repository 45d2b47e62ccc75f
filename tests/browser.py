"""A real browser for tests of pages; they are skipped, with the reason, where there is none."""

import shutil
from contextlib import contextmanager

import pytest

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@contextmanager
def chromium(*flags):
    """Chromium, started without a window."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="Playwright is not installed: pip install -e '.[test]'"
    )
    with playwright.sync_playwright() as driver:
        found = next(filter(None, map(shutil.which, _BROWSERS)), None)
        try:
            # Containers often lack what Chromium's sandbox needs; the page is our own.
            started = driver.chromium.launch(executable_path=found, args=["--no-sandbox", *flags])
        except playwright.Error as error:
            pytest.skip(f"no Chromium could be started: {str(error).splitlines()[0]}")
        yield started
        started.close()
