"""The console as a person uses it: a session in real time, a real browser, a press on stop."""

import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from urllib.parse import urlsplit

import numpy as np
import pytest

from jointz.io.log_reader import read_log
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.session.live.live_session import holder_of, is_held

pytest.importorskip("nicegui", reason="nicegui is not installed")
pytestmark = [
    pytest.mark.alone,
    pytest.mark.usefixtures("terminal_signals_of_module"),
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
without_console = "stop"

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
timing_points = { LRE = 7.0, ISW = 68.5 }
count_per_point = 50
gap_strides = [1, 1]
warm_up_strides = 0
"""


CONTROLLED = """
jointz_protocol = 1
name = "controlled"
title = "Walking under a controller"
kind = "control"
joint = "knee"
positive = "flexion"
seed = 3

[rates]
control_hz = 100.0
sample_hz = 500.0

[gait]
speed_m_s = 1.2
steady_after_strides = 1
strides_in_mean = 2

[[conditions]]
name = "controlled"
condition = "unperturbed"
prompt = "Walk."
strides = 500

[conditions.controller]
name = "four_state"
settings = { share = 0.1 }
"""


#: Fewer than a crowd of connections takes: as if there were thousands of them.
MOST_FILES = 200


class Console:
    """A console's process and what its session writes."""

    def __init__(self, folder, protocol=PROTOCOL):
        (folder / "short.toml").write_text(protocol)
        self.folder, self.study = folder, folder / "study"
        self.session = self.study / "sessions" / "S01"
        self.process = None
        self.open()

    def open(self):
        """Serve the page; a session that was begun is found again."""
        if self.process is not None and self.process.poll() is None:
            return
        command = [sys.executable, "-m", "jointz", "console", "--out", "study", "--port", "0"]
        self.process = subprocess.Popen(
            [*command, "short.toml", *["--resume"] * self.study.exists()],
            cwd=self.folder, stdout=subprocess.PIPE, text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (MOST_FILES, MOST_FILES)),
        )  # fmt: skip
        line = self.process.stdout.readline()
        assert line.startswith("Console: "), line
        self.address = line.split()[1]

    def close(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=15)
        self.process.stdout.close()
        end_session(self)

    def events(self, kind=""):
        """Return the events since the session was started or taken up again."""
        events = read_journal(self.session / "journal.jsonl")
        names = [event["event"] for event in events]
        latest = len(names) - names[::-1].index("prompted") - 1 if "prompted" in names else 0
        return [event for event in events[latest:] if kind in ("", event["event"])]

    def names(self):
        return [event["event"] for event in self.events()]

    def wait_for(self, kind, *, count=1, seconds=15.0):
        deadline = time.monotonic() + seconds
        while len(found := self.events(kind)) < count:
            names = self.names()
            assert "tripped" not in names, names
            assert time.monotonic() < deadline, names
            time.sleep(0.02)
        return found[count - 1]

    def records(self):
        """Return the records of the log that was begun last."""
        logs = (self.session / "logs").glob("perturbed-*.jzlog")
        return read_log(max(logs, key=lambda log: int(log.stem.split("-")[1]))).records


@pytest.fixture(scope="module")
def shared(tmp_path_factory, terminal_signals_of_module):
    """One console for all tests; each brings its session to the state that it begins with."""
    made = Console(tmp_path_factory.mktemp("console"))
    yield made
    made.close()


@pytest.fixture
def made(shared):
    """The shared console, opened again if a test has ended it."""
    shared.open()
    return shared


def end_session(made):
    """Stop what still runs; the session outlives its page."""
    from jointz.rig.console.operator_commands import OperatorCommands

    deadline = time.monotonic() + 15
    while is_held(made.study) and time.monotonic() < deadline:
        OperatorCommands(made.study, None, dict).stop()
        time.sleep(0.05)
    assert not is_held(made.study)


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
    """Wait for a state; a session that was tripped or has failed instead comes to no other."""
    page.wait_for_function(
        f"['{state}', 'tripped', 'failed'].includes(document.body.dataset.state)",
        timeout=1000 * seconds,
    )
    assert page.evaluate("document.body.dataset.state") == state


def wait_to_start(page, made):
    """Open the page and bring the session to where it waits for a start."""
    page.goto(made.address)
    page.wait_for_function("['waiting', 'running', 'stopped', 'tripped', 'failed']"
                           ".includes(document.body.dataset.state)")  # fmt: skip
    if page.evaluate("document.body.dataset.state") == "running":
        page.keyboard.press("Escape")
        state_is(page, "stopped")
    if page.evaluate("document.body.dataset.state") != "waiting":
        rearm(page)
    page.wait_for_selector("#jz-start", state="visible")


def rearm(page):
    acknowledge = page.locator("#jz-acknowledge")
    if acknowledge.is_visible():
        acknowledge.click()
    page.click("#jz-rearm")
    page.click("#jz-yes")
    page.wait_for_function("document.body.dataset.state === 'waiting'")


def start(page):
    page.click("#jz-start")
    state_is(page, "running")


def run(page, made):
    """Open the page of a session that runs, started anew unless it runs already."""
    page.goto(made.address)
    page.wait_for_function("document.body.dataset.state")
    if page.evaluate("document.body.dataset.state") != "running":
        wait_to_start(page, made)
        start(page)


PICTURE = "document.getElementById('jz-traces').toDataURL()"


def picture(page):
    return page.evaluate(PICTURE)


def painted(colour):
    """How many points of the traces have about the colour of a variable of the style sheet."""
    return f"""(() => {{
        const style = getComputedStyle(document.documentElement);
        const hex = style.getPropertyValue('--jz-{colour}').trim();
        const want = [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
        const c = document.getElementById('jz-traces');
        const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        let n = 0;
        for (let i = 0; i < data.length; i += 4)
            n += want.every((v, k) => Math.abs(v - data[i + k]) < 12);
        return n; }})()"""


def test_a_page_answers_nobody_without_the_token(made, page, page_client):
    made.wait_for("prompted")
    assert page_client(made.address).refused_everywhere()

    wait_to_start(page, made)
    assert made.names() == ["prompted"]
    page.provoked = "Failed to load resource: the server responded with a status of 4"
    assert "token" not in page.url
    assert_nonsense_is_refused(page)
    assert_space_stops_and_presses_no_button(page)
    look_on_and_stop(made, page)
    # What was refused, and a start by the space key, would stand between.
    assert made.names() == ["prompted", "stop_asked"]


def assert_nonsense_is_refused(page):
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


def assert_space_stops_and_presses_no_button(page):
    """Press Space while a button has the focus; the stop is kept from the session."""
    page.route("**/stop", lambda route: route.fulfill(json={}))
    page.locator("#jz-start").focus()
    with page.expect_request("**/stop") as request:
        page.keyboard.press("Space")
    assert request.value.method == "POST"
    page.unroute("**/stop")


def look_on_and_stop(made, page):
    """A second page finds the session that runs; all it can do is stop it."""
    command = [sys.executable, "-m", "jointz", "console", "--out", "study", "--port", "0"]
    with subprocess.Popen(command, cwd=made.folder, stdout=subprocess.PIPE, text=True) as second:
        page.goto(second.stdout.readline().split()[1])
        state_is(page, "waiting")
        assert page.evaluate("document.body.dataset.canStart") == "no"
        page.keyboard.press("Space")
        state_is(page, "stopped")
        second.send_signal(signal.SIGINT)
        second.wait(timeout=15)


def test_a_session_is_seen_run_and_stopped_from_a_busy_page(made, page):
    wait_to_start(page, made)
    # Words of a protocol are words, never markup.
    assert page.inner_text("#jz-prompt") == "Walk & keep <b>walking</b>."
    start(page)

    made.wait_for("pulse_completed")
    page.wait_for_function(f"{painted('angle')} > 300 && {painted('applied')} > 100")
    before = picture(page)
    page.wait_for_function(f"{PICTURE} !== '{before}'")  # they move
    assert page.inner_text("#jz-plan").splitlines()[0].startswith("LRE")
    assert re.search(r"newest pulse: \d+, \+17 N·m, at (LRE|ISW)", page.inner_text("#jz-plan"))

    page.fill("#jz-note", "strap & <i>buckle</i>")
    page.keyboard.press("Enter")
    assert made.wait_for("note")["text"] == "strap & <i>buckle</i>"

    page.click("#jz-pause")
    state_is(page, "paused")
    begun = len(made.events("pulse_started"))
    page.wait_for_timeout(1500)  # more than a stride
    assert len(made.events("pulse_started")) == begun
    page.click("#jz-goOn")
    state_is(page, "running")
    made.wait_for("pulse_started", count=begun + 1)

    # Nine tenths of the page's time are gone, and what NiceGUI made of it is, too.
    page.evaluate(
        """() => { document.getElementById('app').remove(); setInterval(() => {
        const t = performance.now(); while (performance.now() - t < 90); }, 100); }"""
    )
    page.keyboard.press("Escape")
    made.wait_for("stopped", seconds=5)
    assert_stopped_in_order(made)
    state_is(page, "stopped")
    assert page.locator("#jz-danger").is_hidden()
    assert page.locator("#jz-alarm").is_hidden()

    # What was stopped goes on only when that is confirmed, and waits for another start.
    page.goto(made.address)
    page.click("#jz-rearm")
    assert "asked for" in page.inner_text("#jz-reason")
    page.click("#jz-yes")
    page.wait_for_function("document.body.dataset.state === 'waiting'")
    assert made.names() == ["prompted"]


def assert_stopped_in_order(made):
    events = made.events()
    names = [event["event"] for event in events]
    asked, stopped = names.index("stop_asked"), names.index("stopped")
    assert asked < stopped == len(names) - 1
    assert "pulse_started" not in names[asked:]
    records = made.records()
    since_s = (records["host_time_ns"] - events[asked]["host_ns"]) * 1e-9
    assert (np.abs(records["sent_torque"][since_s < 0]) > 10).any()
    after = records[since_s >= 0]
    assert after.size
    assert after["sent_torque"][-1] == 0.0
    assert not after["sent_torque"][since_s[since_s >= 0] > FADE_S + 2 * TICK_S].any()
    # The torque only falls.
    steps = np.diff(np.abs(after["sent_torque"]))
    assert (steps <= LARGEST_FRICTION_NM).all()


def test_a_session_that_hangs_and_dies_raises_alarms(made, page, page_client):
    run(page, made)
    other = page.context.new_page()
    other.goto(made.address)
    state_is(other, "running")
    session = holder_of(made.study)
    os.kill(session, signal.SIGSTOP)
    page.provoked = "the server responded with a status of"
    with page.expect_response("**/stop") as answer:
        page.click("#jz-stop")
    assert answer.value.status == 504
    page.locator("#jz-alarm", has_text="Press the emergency stop").wait_for()

    # The alarm of a session that is gone stays until it is acknowledged.
    os.kill(session, signal.SIGKILL)
    for one in (page, other):
        one.locator("#jz-danger", has_text="Use the emergency stop").wait_for(timeout=3000)
    page.click("#jz-stop")
    page.locator("#jz-alarm", has_text="nobody has received the stop").wait_for()
    status, text, _ = page_client(made.address).open().request("POST", "/stop")
    assert status == 409
    assert "nobody has received the stop" in json.loads(text)["refused"]

    page.reload()
    page.locator("#jz-danger").wait_for()
    page.click("#jz-acknowledge")
    page.locator("#jz-danger").wait_for(state="hidden")
    rearm(page)
    start(page)
    assert page.locator("#jz-danger").is_hidden()
    assert other.locator("#jz-danger").is_visible()  # whoever looks there has not acknowledged


def test_idle_connections_do_not_lock_the_operator_out(made, page, page_client):
    with ExitStack() as stack:
        run(page, made)
        client = page_client(made.address)
        where = client.place.split(":")
        for k in range(MOST_FILES):
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


def test_a_lost_page_ends_its_session(made, page):
    run(page, made)
    page.provoked = "ERR_CONNECTION_REFUSED"
    made.process.kill()
    made.process.communicate()
    made.wait_for("stopped_without_console", seconds=8)
    made.wait_for("stopped", seconds=3)
    page.locator("#jz-alarm", has_text="This page hears nothing").wait_for()
    page.keyboard.press("Escape")
    page.locator("#jz-alarm", has_text="emergency stop").wait_for()


@pytest.fixture
def controlled(tmp_path):
    made = Console(tmp_path, CONTROLLED)
    yield made
    made.close()


def test_a_parameter_of_a_controller_is_set_and_undone(controlled, page):
    wait_to_start(page, controlled)
    assert page.locator("#jz-controller").is_hidden()
    start(page)
    field = page.locator("#jz-controller input")
    assert field.input_value() == "0.1"

    page.provoked = "Failed to load resource: the server responded with a status of 422"
    field.fill("1.5")
    page.click("#jz-controller >> text=Set")
    page.locator("#jz-alarm", has_text="Not done: share: 1.5; expected 0 to 1.").wait_for()

    field.fill("0.2")
    field.press("Enter")
    changed = controlled.wait_for("parameter_changed")
    assert (changed["name"], changed["before"], changed["after"]) == ("share", 0.1, 0.2)
    page.fill("#jz-note", "u")  # a letter of a note undoes nothing
    page.keyboard.press("u")
    page.locator("#jz-note").blur()
    page.keyboard.press("u")
    assert controlled.wait_for("parameter_undone")["after"] == 0.1
    page.wait_for_function("document.querySelector('#jz-controller input').value === '0.1'")
    page.click("#jz-controller >> text=Undo")
    assert controlled.wait_for("control_refused")["order"] == "undo"
    assert len(controlled.events("parameter_undone")) == 1

    page.keyboard.press("Escape")
    state_is(page, "stopped")
    assert page.locator("#jz-controller").is_hidden()
