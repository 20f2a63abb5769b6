"""The console as a person uses it: a session in real time, a real browser, a press on stop."""

import http.client
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="nicegui is not installed")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")

from jointz.experiment.journal import read_journal  # noqa: E402 - after the skips
from jointz.io.session_log import read_log  # noqa: E402

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), "")
pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(not BROWSER, reason="no chromium on this machine"),
]

#: Friction that zero-torque control cancels is sent outside pulses, too; a pulse has 17 N*m.
LARGEST_FRICTION_NM = 3.0
FADE_S = 0.05
TICK_S = 0.01  # slow: a machine that has other things to do must not trip `overrun`
PROTOCOL = """
jointz_protocol = 1
name = "short"
title = "A few pulses"
kind = "walking"
joint = "knee"
seed = 3
without_console = "{without}"

[rates]
control_hz = 100.0
sample_hz = 500.0

[gait]
speed_m_s = 1.2
steady_after_strides = 1
strides_in_mean = 2

[pulse]
amplitude_nm = 17.0
duration_s = 0.25
hold_s = 0.25

[[conditions]]
name = "perturbed"
condition = "perturbed"
prompt = "Walk & keep <b>walking</b>."

[conditions.perturbations]
timing_points = {{ LRE = 7.0, ISW = 68.5 }}
count_per_point = 50
gap_strides = [1, 1]
warm_up_strides = 2
"""


class Console:
    """A console's process and what its session writes."""

    def __init__(self, folder, process, address):
        self.study, self.process, self.address = folder / "study", process, address
        self.session = self.study / "sessions" / "S01"

    def events(self, kind=""):
        return [
            event
            for event in read_journal(self.session / "journal.jsonl")
            if kind in ("", event["event"])
        ]

    def wait_for(self, kind, *, count=1, seconds=15.0):
        deadline = time.monotonic() + seconds
        while len(found := self.events(kind)) < count:
            assert time.monotonic() < deadline, [event["event"] for event in self.events()]
            time.sleep(0.02)
        return found[count - 1]

    def request(self, method, path, body=None, **headers):
        where = urlsplit(self.address)
        connection = http.client.HTTPConnection("127.0.0.1", where.port, timeout=10)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        answer = connection.getresponse()
        status, text = answer.status, answer.read().decode(errors="replace")
        connection.close()
        return status, text, answer


@contextmanager
def console(folder, *arguments, without="go_on"):
    (folder / "short.toml").write_text(PROTOCOL.format(without=without))
    command = [sys.executable, "-m", "jointz", "console", "--out", "study", "--port", "0"]
    process = subprocess.Popen(
        [*command, *arguments], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    made = None
    try:
        line = process.stdout.readline()
        assert line.startswith("Console: "), line
        made = Console(folder, process, line.split()[1])
        yield made
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=15)
        process.stdout.close()
        if made is not None:
            end_session(made)


def end_session(made):
    """Stop what still runs; the session outlives its page."""
    from jointz.app.desk import Desk
    from jointz.workflows.live_session import is_held

    deadline = time.monotonic() + 15
    while is_held(made.study) and time.monotonic() < deadline:
        Desk(made.study, None, dict).stop()
        time.sleep(0.05)
    assert not is_held(made.study)


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield made
        made.close()


@pytest.fixture
def page(browser):
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    made = context.new_page()
    made.troubles = []
    made.on("pageerror", lambda error: made.troubles.append(str(error)))
    # Nothing may come from elsewhere.
    made.on(
        "request",
        lambda request: (
            None
            if urlsplit(request.url).hostname in ("127.0.0.1", None)
            else made.troubles.append(request.url)
        ),
    )
    yield made
    assert made.troubles == []
    context.close()


def state_is(page, state, seconds=20):
    page.wait_for_function(f"document.body.dataset.state === '{state}'", timeout=1000 * seconds)


def begin(page, made, *, opened=False):
    if not opened:
        page.goto(made.address)
    state_is(page, "waiting")
    page.wait_for_selector("#jz-start", state="visible")
    page.click("#jz-start")
    state_is(page, "running")


def picture(page, name):
    return page.evaluate(f"document.getElementById('{name}').toDataURL()")


def painted(page, name, colour):
    """How many points of a canvas have about the colour of a variable of the style sheet."""
    return page.evaluate(
        f"""() => {{
        const style = getComputedStyle(document.documentElement);
        const hex = style.getPropertyValue('--jz-{colour}').trim();
        const want = [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
        const c = document.getElementById('{name}');
        const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        let n = 0;
        for (let i = 0; i < data.length; i += 4)
            n += want.every((v, k) => Math.abs(v - data[i + k]) < 12);
        return n; }}"""
    )


def test_a_session_is_seen_run_and_stopped_from_the_page(tmp_path, page):
    with console(tmp_path, "short.toml") as made:
        page.goto(made.address)
        state_is(page, "waiting")
        # Words of a protocol are words, never markup.
        assert page.inner_text("#jz-prompt") == "Walk & keep <b>walking</b>."
        begin(page, made)

        made.wait_for("pulse_completed")
        page.wait_for_timeout(300)
        before = picture(page, "jz-traces")
        assert painted(page, "jz-traces", "angle") > 300
        assert painted(page, "jz-traces", "applied") > 100
        page.wait_for_timeout(300)
        assert picture(page, "jz-traces") != before  # they move
        assert page.inner_text("#jz-plan").splitlines()[0].startswith("LRE")

        page.fill("#jz-note", "strap & <i>buckle</i>")
        page.keyboard.press("Enter")
        assert made.wait_for("note")["text"] == "strap & <i>buckle</i>"

        page.click("#jz-pause")
        state_is(page, "paused")
        page.wait_for_timeout(400)
        done = len(made.events("pulse_started"))
        page.wait_for_timeout(1500)
        assert len(made.events("pulse_started")) == done
        page.click("#jz-goOn")
        state_is(page, "running")

        made.wait_for("pulse_started", count=done + 1)
        page.click("#jz-stop")
        state_is(page, "stopped")
        assert_stopped_in_order(made)

        # What was stopped goes on only when that is confirmed, and waits for another start.
        page.click("#jz-rearm")
        assert "asked for" in page.inner_text("#jz-reason")
        page.click("#jz-yes")
        state_is(page, "waiting")
        page.locator("#jz-start").focus()
        page.keyboard.press("Space")  # a stop, not a press on the button that has the focus
        state_is(page, "stopped")
        assert [e["event"] for e in made.events()][-2:] == ["prompted", "stop_asked"]


def assert_stopped_in_order(made):
    events = made.events()
    names = [event["event"] for event in events]
    asked, stopped = names.index("stop_asked"), names.index("stopped")
    assert asked < stopped == len(names) - 1
    assert "pulse_started" not in names[asked:]
    records = read_log(made.session / "logs" / "perturbed-0.jzlog").records
    since_s = (records["host_time_ns"] - events[asked]["host_ns"]) * 1e-9
    assert (np.abs(records["sent_torque"][since_s < 0]) > 10).any()
    after = records[since_s >= 0]
    assert after.size
    assert after["sent_torque"][-1] == 0.0
    assert not after["sent_torque"][since_s[since_s >= 0] > FADE_S + 2 * TICK_S].any()
    # The torque only falls.
    steps = np.diff(np.abs(after["sent_torque"]))
    assert (steps <= LARGEST_FRICTION_NM).all()


def test_a_busy_page_still_stops_and_a_lost_one_ends_what_it_should(tmp_path, browser, page):
    with console(tmp_path, "short.toml", without="stop") as made:
        begin(page, made)
        made.wait_for("pulse_started")
        # Nine tenths of the page's time are gone, and what NiceGUI made of it is, too.
        page.evaluate(
            """() => { document.getElementById('app').remove(); setInterval(() => {
            const t = performance.now(); while (performance.now() - t < 90); }, 100); }"""
        )
        page.keyboard.press("Escape")
        made.wait_for("stopped", seconds=5)
        assert_stopped_in_order(made)
        page.goto(made.address)
        state_is(page, "stopped")
        page.click("#jz-rearm")
        page.click("#jz-yes")
        begin(page, made, opened=True)
        page.wait_for_timeout(500)
        made.process.send_signal(signal.SIGKILL)
        made.process.wait()
        made.wait_for("stopped_without_console", seconds=8)
        made.wait_for("stopped", count=2, seconds=3)
        page.wait_for_function("!document.getElementById('jz-alarm').hidden")
        page.keyboard.press("Escape")
        page.wait_for_function(
            "document.getElementById('jz-alarm').textContent.includes('emergency stop')"
        )


def test_a_page_elsewhere_answers_nobody_without_the_token(tmp_path, page):
    with console(tmp_path, "short.toml", "--listen", "0.0.0.0") as made:
        made.wait_for("prompted")
        where = urlsplit(made.address)
        own = {"Host": f"127.0.0.1:{where.port}", "Origin": f"http://127.0.0.1:{where.port}"}
        for method, path in [("GET", "/"), ("POST", "/stop"), ("POST", "/command")]:
            status, text, _ = made.request(method, path, **own)
            assert (status, "jointz" in text) == (403, False)
        assert made.events("stop_asked") == []

        page.goto(f"http://127.0.0.1:{where.port}/?{where.query}")
        state_is(page, "waiting")
        assert "token" not in page.url
        assert_nonsense_is_refused(made, page)
        look_on_and_stop(tmp_path, page)


def look_on_and_stop(folder, page):
    """A second page finds the session that runs; all it can do is stop it."""
    command = [sys.executable, "-m", "jointz", "console", "--out", "study", "--port", "0"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as second:
        page.goto(second.stdout.readline().split()[1])
        state_is(page, "waiting")
        assert page.evaluate("document.body.dataset.canStart") == "no"
        page.keyboard.press("Space")
        state_is(page, "stopped")
        second.send_signal(signal.SIGINT)
        second.wait(timeout=15)


def assert_nonsense_is_refused(made, page):
    """From inside, too: what is not a command of ours goes nowhere."""
    told = page.evaluate(
        """async () => {
        const ask = async (body) => (await fetch('/command', {method: 'POST', body})).status;
        const seen = [];
        const bodies = ['', '{}', '{"order":"torque"}', 'x'.repeat(9000)];
        for (const body of bodies) seen.push(await ask(body));
        const socket = new WebSocket(`ws://${location.host}/live`);
        const code = await new Promise((done) => {
            socket.onmessage = () => socket.send('{"order":"start"}');
            socket.onclose = (event) => done(event.code);
        });
        return [...seen, code];
        }"""
    )
    assert told == [422, 422, 422, 413, 1008]
    assert [e["event"] for e in made.events()] == ["prompted"]
