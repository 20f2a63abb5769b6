"""The report as a person sees it: in a real browser, with no network."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    # Nothing may be fetched: every host resolves to nowhere.
    "--host-resolver-rules=MAP * ~NOTFOUND",
)


def screenshot(page: Path, picture: Path) -> np.ndarray:
    """Return the page's first 4000 pixels as a grey picture, 0..255."""
    subprocess.run(
        [
            BROWSER,
            *FLAGS,
            f"--user-data-dir={picture.parent / 'profile'}",
            "--window-size=1200,4000",
            f"--screenshot={picture}",
            page.as_uri(),
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    with Image.open(picture) as image:
        return np.asarray(image.convert("L"))


def errors_of_scripts(page: Path, script_errors) -> list[str]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=list(FLAGS))
        opened = browser.new_page()
        errors = script_errors(opened)
        opened.goto(page.as_uri())
        opened.wait_for_timeout(500)
        browser.close()
    return errors


@pytest.mark.skipif(not BROWSER, reason="no chromium on this machine to look at the report with")
def test_the_report_opens_offline_and_shows_text_and_figures(
    small_study, analyze, tmp_path, script_errors
):
    analyze(small_study)

    picture = screenshot(tmp_path / "results" / "report.html", tmp_path / "report.png")

    assert picture.shape == (4000, 1200)
    dark = picture < 128
    assert 0.005 < dark.mean() < 0.3  # neither blank nor black
    # Every stretch of a screen's height holds something: no section failed to draw.
    assert all(screen.any() for screen in np.array_split(dark, 5))
    # The text is laid out in a column with margins, not run to the edges.
    assert not dark[:, :40].any()
    assert not dark[:, -40:].any()
    assert errors_of_scripts(tmp_path / "results" / "report.html", script_errors) == []
