"""The console as a person uses it: a session in real time, a real browser, a press on stop."""

import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="nicegui is not installed")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")

from jointz.experiment.files.journal import read_journal  # noqa: E402 - after the skips
from jointz.io.log_reader import read_log  # noqa: E402
from jointz.session.live.live_session import holder_of, is_held  # noqa: E402

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), "")
pytestmark = [
    pytest.mark.alone,
    pytest.mark.usefixtures("terminal_signals"),
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


@contextmanager
def console(folder, *arguments, without="go_on", most_files=1024):
    (folder / "short.toml").write_text(PROTOCOL.format(without=without))
    command = [sys.executable, "-m", "jointz", "console", "--out", "study", "--port", "0"]
    process = subprocess.Popen(
        [*command, *arguments], cwd=folder, stdout=subprocess.PIPE, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (most_files, most_files)),
    )  # fmt: skip
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
    from jointz.console.operator_commands import OperatorCommands

    deadline = time.monotonic() + 15
    while is_held(made.study) and time.monotonic() < deadline:
        OperatorCommands(made.study, None, dict).stop()
        time.sleep(0.05)
    assert not is_held(made.study)


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield made
        made.close()


@pytest.fixture
def page(browser, script_errors):
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    made = context.new_page()
    made.troubles = script_errors(made)
    made.provoked = "nothing"  # how errors begin that a test provokes
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
    assert [trouble for trouble in made.troubles if made.provoked not in trouble] == []
    context.close()


def state_is(page, state, seconds=60):
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
        assert page.locator("#jz-danger").is_hidden()
        assert page.locator("#jz-alarm").is_hidden()

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
        page.provoked = "ERR_CONNECTION_REFUSED"
        made.process.send_signal(signal.SIGKILL)
        made.process.wait()
        made.wait_for("stopped_without_console", seconds=8)
        made.wait_for("stopped", count=2, seconds=3)
        page.wait_for_function("!document.getElementById('jz-alarm').hidden")
        page.keyboard.press("Escape")
        page.wait_for_function(
            "document.getElementById('jz-alarm').textContent.includes('emergency stop')"
        )


def test_a_killed_session_raises_an_alarm_that_stays_until_it_is_acknowledged(
    tmp_path, page, page_client
):
    with console(tmp_path, "short.toml") as made:
        begin(page, made)
        other = page.context.new_page()
        other.goto(made.address)
        made.wait_for("pulse_started")
        os.kill(holder_of(made.study), signal.SIGKILL)
        for one in (page, other):
            one.locator("#jz-danger", has_text="Use the emergency stop").wait_for(timeout=3000)

        page.provoked = "409"
        page.click("#jz-stop")
        page.locator("#jz-alarm", has_text="nobody has received the stop").wait_for()
        status, text, _ = page_client(made.address).open().request("POST", "/stop")
        assert status == 409
        assert "nobody has received the stop" in json.loads(text)["refused"]

        page.reload()
        page.locator("#jz-danger").wait_for()
        page.click("#jz-acknowledge")
        page.locator("#jz-danger").wait_for(state="hidden")
        page.click("#jz-rearm")
        page.click("#jz-yes")
        begin(page, made, opened=True)
        assert page.locator("#jz-danger").is_hidden()
        assert other.locator("#jz-danger").is_visible()  # whoever looks there has not acknowledged


def test_idle_connections_do_not_lock_the_operator_out(tmp_path, page, page_client):
    # Fewer files than connections: as if there were thousands of them.
    with console(tmp_path, "short.toml", most_files=200) as made, ExitStack() as stack:
        begin(page, made)
        client = page_client(made.address)
        where = client.place.split(":")
        for k in range(200):
            idle = stack.enter_context(socket.create_connection(where, timeout=5))
            idle.sendall(b"GET / HTTP/1.1\r\n" * (k % 2))
        client.open()
        for _ in range(20):
            stack.enter_context(client.socket("/live"))

        began = time.monotonic()
        assert client.request("GET", "/")[0] == 200
        with client.socket("/live") as live:
            assert json.loads(live.recv(timeout=1))["status"]["state"] == "running"
            live.send("next")
            assert json.loads(live.recv(timeout=1))["rows"]
        assert client.request("POST", "/stop")[0] == 200
        made.wait_for("stop_asked", seconds=1)
        assert time.monotonic() - began < 1
        page.reload()
        state_is(page, "stopped")


@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0"])
def test_a_page_answers_nobody_without_the_token(tmp_path, page, page_client, listen):
    with console(tmp_path, "short.toml", "--listen", listen) as made:
        made.wait_for("prompted")
        where = urlsplit(made.address)
        address = f"http://127.0.0.1:{where.port}/?{where.query}"
        assert page_client(address).refused_everywhere()
        assert made.events("stop_asked") == []

        page.goto(address)
        state_is(page, "waiting")
        page.provoked = "Failed to load resource: the server responded with a status of 4"
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
