"""The report as a person sees it: in a real browser, with no network."""

import io

import numpy as np
from PIL import Image


def test_the_report_opens_offline_and_shows_text_and_figures(small_results, browser, script_errors):
    report = (small_results / "report.html").as_uri()
    context = browser.new_context(viewport={"width": 1200, "height": 4000}, offline=True)
    page = context.new_page()
    errors, asked = script_errors(page), []
    page.on("request", lambda request: asked.append(request.url))

    page.goto(report)
    closed = page.evaluate("document.body.scrollHeight")
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    page.wait_for_timeout(500)
    with Image.open(io.BytesIO(page.screenshot())) as image:
        picture = np.asarray(image.convert("L"))
    first = page.evaluate("document.querySelector('#first').getBoundingClientRect().bottom")
    context.close()

    assert first < 1400
    assert closed < 2200
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


def test_a_link_opens_the_section_it_leads_to_and_print_opens_all(
    small_results, browser, script_errors
):
    page = browser.new_page(viewport={"width": 1200, "height": 1400})
    errors = script_errors(page)
    page.goto((small_results / "report.html").as_uri())
    opened = "[...document.querySelectorAll('details.fold')].filter(d => d.open).length"
    assert page.evaluate(opened) == 0

    page.click("nav a[href='#excluded']")
    assert page.evaluate(opened) == 1
    assert page.locator("#excluded").is_visible()

    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(opened) == page.locator("details.fold").count()
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(opened) == 1
    page.close()
    assert errors == []
