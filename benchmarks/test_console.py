"""How soon a press on the page's stop takes the torque away, and what the page costs the loop.

Both run a simulated session at 500 Hz in real time, its console, and a headless Chromium that
shows it. The loop's figures are of alternating blocks of one run: in one kind the page is open;
in the other the browser shows nothing and the console's process is held (SIGSTOP), which costs
the machine what an absent one does, without the work of starting it in between. The machine
should have nothing else to do. With ``--benchmark-disable`` everything runs once and short, and
no figure is asserted.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from benchmarks.figures import Peer, at_most
from scipy.stats import mannwhitneyu

pytest.importorskip("nicegui", reason="nicegui is not installed")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")

from jointz.experiment.files.journal import read_journal  # noqa: E402 - after the skips
from jointz.io.log_reader import read_log  # noqa: E402

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), "")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.alone,
    pytest.mark.skipif(not BROWSER, reason="no chromium on this machine"),
]

CLICKS, BLOCKS, BLOCK_S, SETTLE_S = 20, 5, 8.0, 2.0
MOST_TRIPS = 5  # `overrun`, where the machine has something else to do
PERIOD_NS = 2_000_000
AIM_MS = 50.0
PROTOCOL = """
jointz_protocol = 1
name = "bench"
title = "Many pulses"
kind = "walking"
joint = "knee"
seed = 3
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
prompt = "Walk."
[conditions.perturbations]
timing_points = { LRE = 7.0, ISW = 68.5 }
count_per_point = 400
gap_strides = [1, 1]
warm_up_strides = 2
"""


class Running:
    """A session with its console and a browser that shows it."""

    def __init__(self, folder, process, page, address):
        self.process, self.page, self.address = process, page, address
        self.session = folder / "study" / "sessions" / "S01"

    def events(self):
        return read_journal(self.session / "journal.jsonl")

    def is_in(self, *states):
        wanted = " || ".join(f"document.body.dataset.state === '{one}'" for one in states)
        self.page.wait_for_function(wanted, timeout=30_000)
        return self.page.evaluate("document.body.dataset.state")

    def begin(self):
        """Have it run, from whatever state it is in."""
        state = self.is_in("waiting", "running", "stopped", "tripped")
        if state in ("stopped", "tripped"):
            self.page.click("#jz-rearm")
            self.page.click("#jz-yes")
            state = self.is_in("waiting")
        if state == "waiting":
            self.page.click("#jz-start")
        self.is_in("running")

    def records(self):
        logs = sorted(
            (self.session / "logs").glob("*.jzlog"), key=lambda file: file.stat().st_mtime
        )
        return [read_log(file).records for file in logs]


@contextmanager
def running(folder: Path):
    (folder / "bench.toml").write_text(PROTOCOL)
    command = [sys.executable, "-m", "jointz", "console", "bench.toml", "--out", "study"]
    process = subprocess.Popen(
        [*command, "--port", "0"], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    try:
        address = process.stdout.readline().split()[1]
        with sync_api.sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.goto(address)
            made = Running(folder, process, page, address)
            yield made
            page.keyboard.press("Escape")
            made.is_in("stopped", "tripped")
            browser.close()
    finally:
        process.send_signal(signal.SIGCONT)
        process.send_signal(signal.SIGINT)
        process.wait(timeout=20)
        process.stdout.close()


def one_stop(made: Running) -> tuple[float, float, bool] | None:
    """Press stop in a pulse; ms to the stop and to zero torque, and whether a pulse was on."""
    made.begin()
    made.page.evaluate(
        """() => addEventListener('pointerdown', (e) => {
        window.pressedMs = performance.timeOrigin + e.timeStamp; }, {capture: true, once: true})"""
    )
    pulses = sum(event["event"] == "pulse_started" for event in made.events())
    deadline = time.monotonic() + 15
    while sum(event["event"] == "pulse_started" for event in made.events()) == pulses:
        if time.monotonic() > deadline:  # tripped: the machine was busy with something else
            return None
        time.sleep(0.005)
    made.page.click("#jz-stop")
    if made.is_in("stopped", "tripped") == "tripped":
        return None
    asked = next(event for event in reversed(made.events()) if event["event"] == "stop_asked")
    records = made.records()[-1]
    after = records[records["host_time_ns"] >= asked["host_ns"]]
    zero = after["host_time_ns"][after["sent_torque"] == 0.0][0]
    to_stop = asked["time_ns"] * 1e-6 - made.page.evaluate("window.pressedMs")
    before = records[records["host_time_ns"] < asked["host_ns"]]
    return to_stop, to_stop + float(zero - asked["host_ns"]) * 1e-6, before["pulse"][-1] > 0


def test_a_stop_takes_the_torque_away_soon(tmp_path, quick, figures):
    with running(tmp_path) as made:
        found = [one_stop(made) for _ in range(1 if quick else CLICKS)]
    done = [one for one in found if one is not None]
    print(
        f"\n{len(done)} presses on stop, {len(found) - len(done)} lost to trips of a busy machine"
    )
    if not done:
        figures.left_out("a press on stop", "every one was lost to a trip: the machine was busy")
        return
    to_stop, to_zero, in_pulse = (np.array(column) for column in zip(*done, strict=True))
    told("press to stop, ms", to_stop)
    told("press to zero torque, ms: all", to_zero)
    told("  in a pulse, which fades", to_zero[in_pulse])
    told("  outside pulses", to_zero[~in_pulse])
    figures.alone("press on stop to the stop, median", np.median(to_stop), "ms")
    what = "press on stop to zero torque, median"
    figures.alone(what, np.median(to_zero), "ms", asked=at_most(AIM_MS))
    if not quick:
        print(f"  aim {AIM_MS:g} ms: {'met' if np.median(to_zero) <= AIM_MS else 'missed'}")


def told(what: str, values: np.ndarray) -> None:
    if values.size:
        low, median, high = np.percentile(values, [0, 50, 100])
        print(f"  {what:<34} median {median:7.1f}  from {low:7.1f} to {high:7.1f}  n {values.size}")


def block(made: Running, seconds: float) -> dict[str, float] | None:
    """Let the session run for a while and say how its loop kept its time; None if it tripped."""
    time.sleep(SETTLE_S)
    begin = time.perf_counter_ns()
    time.sleep(seconds)
    records = made.records()[-1]
    ticks = records[(records["part"] == 0) & (records["host_time_ns"] >= begin)]
    slots = ticks["slot"].astype(np.int64)
    if ticks.size < 2 or made.events()[-1]["event"] in ("tripped", "stopped"):
        return None
    return {
        "missed slots a second": float((np.diff(slots) - 1).sum()) / seconds,
        "late p99, us": float(np.percentile(ticks["host_time_ns"] % PERIOD_NS, 99) / 1e3),
        "busy p99, us": float(np.percentile(ticks["busy_us"], 99)),
    }


def pair(made: Running, seconds: float) -> dict[str, dict[str, float] | None]:
    """One block with the page and one without, of one session."""
    made.page.goto(made.address)
    made.begin()
    found = {"with": block(made, seconds)}
    made.page.goto("about:blank")
    os.kill(made.process.pid, signal.SIGSTOP)
    found["without"] = block(made, seconds)
    os.kill(made.process.pid, signal.SIGCONT)
    return found


@pytest.mark.slow
def test_the_loop_does_not_feel_the_page(tmp_path, quick, figures):
    wanted, pairs, tripped = 1 if quick else BLOCKS, [], 0
    with running(tmp_path) as made:
        while len(pairs) < wanted and tripped < MOST_TRIPS:
            found = pair(made, 1.0 if quick else BLOCK_S)
            if all(found.values()):
                pairs.append(found)
            else:
                tripped += 1
        made.page.goto(made.address)
        made.is_in("running", "tripped")
    print(f"\nthe loop at 500 Hz, {len(pairs)} pairs of blocks; {tripped} left out for a trip")
    if not pairs:
        figures.left_out("the loop with the page open", "the machine was busy: every block tripped")
    for name in pairs[0]["with"] if pairs else ():
        columns = {kind: np.array([one[kind][name] for one in pairs]) for kind in pairs[0]}
        for kind, values in columns.items():
            told(f"{name} {kind}", values)
        said = ""
        if len(pairs) > 1:
            p = mannwhitneyu(columns["with"], columns["without"]).pvalue
            said = f"{'told apart' if p < 0.05 else 'cannot be told apart'}, p = {p:.2f}"
            print(f"  {said}")
        what, unit = name.split(", ") if ", " in name else (name, "")
        medians = (np.median(columns["with"]), np.median(columns["without"]))
        peer = Peer("without the page")
        figures.beside(f"loop at 500 Hz, page open: {what}", peer, medians, unit, note=said)
