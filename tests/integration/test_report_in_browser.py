"""The report as a person sees it: in a real browser, with no network."""

import io

import numpy as np
from PIL import Image


def test_the_report_opens_offline_and_shows_text_and_figures(
    small_study, analyze, tmp_path, browser, script_errors
):
    analyze(small_study)
    report = (tmp_path / "results" / "report.html").as_uri()
    context = browser.new_context(viewport={"width": 1200, "height": 4000}, offline=True)
    page = context.new_page()
    errors, asked = script_errors(page), []
    page.on("request", lambda request: asked.append(request.url))

    page.goto(report)
    page.wait_for_timeout(500)
    with Image.open(io.BytesIO(page.screenshot())) as image:
        picture = np.asarray(image.convert("L"))
    context.close()

    assert errors == []
    assert [url for url in asked if url != report and not url.startswith("data:")] == []
    assert picture.shape == (4000, 1200)
    dark = picture < 128
    assert 0.005 < dark.mean() < 0.3  # neither blank nor black
    # Every stretch of a screen's height holds something: no section failed to draw.
    assert all(screen.any() for screen in np.array_split(dark, 5))
    # The text is laid out in a column with margins, not run to the edges.
    assert not dark[:, :40].any()
    assert not dark[:, -40:].any()
