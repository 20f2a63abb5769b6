// The console in the browser: listens to the session, shows it, and passes on what is asked for.
// The stop hangs on nothing else: no library, no socket, no drawing.
"use strict";

const jointzConsole = (() => {
  const byId = (id) => document.getElementById(id);
  const MOVES = new Set(["starting", "running", "paused", "stopping", "silent"]);
  const WORDS = {
    idle: "no session", waiting: "ready to start", starting: "starting", running: "running",
    paused: "pulses paused", stopping: "stopping", stopped: "stopped", tripped: "tripped",
    failed: "failed", writing: "writing the study", done: "done", silent: "no records",
  };
  let status = { state: "" };
  let rows = [], strikes = [];
  let heard = -1e9, ahead = 0, latest = 0;

  // ---------------------------------------------------------------- stop
  let stopAskedAt = 0;

  function stop() {
    const button = byId("jz-stop");
    button.classList.add("asked");
    if (!stopAskedAt) stopAskedAt = performance.now();
    sendStop(0);
  }

  function sendStop(tries) {
    fetch("/stop", { method: "POST", keepalive: true, cache: "no-store" })
      .then(async (answer) => {
        if (answer.status === 409) unheard((await answer.json()).refused);
        else if (answer.status === 504) unconfirmed((await answer.json()).refused);
        else if (!answer.ok) throw new Error(String(answer.status));
      })
      .catch(() => {
        alarm("stop", "The stop has not reached the session. Use the emergency stop.");
        if (tries < 50) setTimeout(() => sendStop(tries + 1), 200);
      });
  }

  // Nobody has received the stop: says so until the session's state changes.
  let unheardIn = "";
  function unheard(why) {
    unheardIn = status.state;
    endStop();
    alarm("unheard", why);
  }

  // The session has the stop and does not answer: says so, and goes on waiting for it.
  function unconfirmed(why) {
    if (status.state === "stopping" || status.state === "stopped") return; // answered by now
    unheardIn = status.state;
    alarm("unheard", why);
  }

  function endStop() {
    stopAskedAt = 0;
    byId("jz-stop").classList.remove("asked");
    alarm("stop", "");
  }

  function watchStop() {
    if (!stopAskedAt) return;
    if (!MOVES.has(status.state) && status.state !== "waiting") {
      endStop();
    } else if (performance.now() - stopAskedAt > 1500 && status.state !== "stopping" && !alarms.has("unheard")) {
      alarm("stop", "The session does not answer to the stop. Use the emergency stop.");
    }
  }

  byId("jz-stop").addEventListener("pointerdown", stop);
  // By key or assistive technology; the click of a pointer is a stop that was asked for already.
  byId("jz-stop").addEventListener("click", (event) => { if (!event.detail) stop(); });
  window.addEventListener("keydown", (event) => {
    const writes = event.target && event.target.id === "jz-note";
    if (event.code !== "Escape" && (event.code !== "Space" || writes)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) stop();
  }, true);
  // A button that has the focus must not take the space key as a press of its own.
  window.addEventListener("keyup", (event) => {
    if (event.code === "Space" && !(event.target && event.target.id === "jz-note")) event.preventDefault();
  }, true);

  // ---------------------------------------------------------------- commands
  async function ask(message) {
    try {
      const answer = await fetch("/command", {
        method: "POST", cache: "no-store", body: JSON.stringify(message),
        headers: { "content-type": "application/json" },
      });
      const told = await answer.json();
      alarm("command", answer.ok ? "" : `Not done: ${told.refused}`, 6000);
      return answer.ok;
    } catch {
      alarm("command", "Not done: the page's server does not answer.", 6000);
      return false;
    }
  }

  const start = () => ask({ order: "start", condition: status.condition });
  const pause = () => ask({ order: "pause" });
  const goOn = () => ask({ order: "go_on" });
  const undo = () => ask({ order: "undo" });
  const listens = () => Boolean(status.controller) && ["running", "paused"].includes(status.state);

  window.addEventListener("keydown", (event) => {
    const writes = event.target instanceof Element && event.target.closest("input, textarea");
    if (writes || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key.toLowerCase() === "u" && listens()) undo();
  });

  async function setParameter(name, field) {
    if (field.value.trim() === "") {
      alarm("command", `Not done: ${name}: enter a number.`, 6000);
      return;
    }
    if (!(await ask({ order: "set", name, value: Number(field.value) }))) return;
    field.dataset.shown = field.value; // no longer edited: follows the session again
    field.blur();
  }

  async function note() {
    const field = byId("jz-note");
    const text = field.value.trim();
    if (!text || !(await ask({ order: "note", text }))) return;
    field.value = "";
    field.dispatchEvent(new Event("input", { bubbles: true }));
    field.blur();
  }

  function rearm() {
    byId("jz-reason").textContent = `${WORDS[status.state]}: ${status.reason || "no reason was written down"}`;
    byId("jz-confirm").dataset.reason = status.reason || "";
    byId("jz-confirm").showModal();
  }
  byId("jz-no").addEventListener("click", () => byId("jz-confirm").close());
  byId("jz-yes").addEventListener("click", () => {
    byId("jz-confirm").close();
    ask({ order: "rearm", reason: byId("jz-confirm").dataset.reason });
  });

  // ---------------------------------------------------------------- alarms
  const alarms = new Map();

  function alarm(of, text, forMs = 0) {
    if (text) alarms.set(of, text); else alarms.delete(of);
    const box = byId("jz-alarm");
    const told = [...alarms.values()].join("  ");
    if (box.textContent !== told) box.textContent = told;
    box.hidden = !told;
    if (text && forMs) setTimeout(() => { if (alarms.get(of) === text) alarm(of, ""); }, forMs);
  }

  // A session that ended without confirming that its devices stopped: stays until acknowledged,
  // whatever comes next.
  let danger = "", acknowledged = "";
  function watchDevices() {
    const unconfirmed = status.unconfirmed || "";
    if (unconfirmed && unconfirmed !== acknowledged) danger = unconfirmed;
    if (!unconfirmed) acknowledged = "";
    set("jz-danger-of", danger && `${status.study}, ${status.participant}, ${danger}`);
    byId("jz-danger").hidden = !danger;
  }
  byId("jz-acknowledge").addEventListener("click", () => {
    acknowledged = danger;
    danger = "";
    watchDevices();
  });

  // ---------------------------------------------------------------- the feed
  function connect() {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.onmessage = (message) => {
      socket.send("next"); // at once: what is drawn late is not worth waiting for
      take(JSON.parse(message.data));
    };
    socket.onclose = () => setTimeout(connect, 500);
  }

  function take(frame) {
    heard = performance.now();
    if (frame.anew) { rows = []; strikes = []; latest = ahead = 0; }
    const columns = frame.rows;
    for (let i = 0; i < columns[0].length; i++) rows.push(columns.map((column) => column[i]));
    if (columns[0].length) {
      const newest = rows[rows.length - 1][0];
      while (rows[0][0] < newest - 30) rows.shift();
      // Time runs smoothly from row to row, whenever they come.
      const offset = newest - heard / 1000;
      ahead = latest ? ahead + Math.max(-0.05, Math.min(0.05, offset - ahead)) * 0.1 : offset;
      if (Math.abs(offset - ahead) > 0.5) ahead = offset;
      latest = newest;
    }
    strikes = frame.strikes;
    if (frame.status) { status = frame.status; show(); }
  }

  // ---------------------------------------------------------------- words
  const write = (e, text) => { if (e && e.textContent !== text) e.textContent = text; };
  const set = (id, text) => write(byId(id), text);
  const make = (tag, kind, text) => {
    const e = document.createElement(tag);
    if (kind) e.className = kind;
    if (text !== undefined) e.textContent = text; // never markup: names are of strangers
    return e;
  };
  const shown = new Map();
  // Replaces what a card holds, when it changed.
  function fill(id, key, build) {
    const e = byId(id), now = JSON.stringify(key);
    if (!e || (shown.get(id) === now && e.childElementCount)) return;
    shown.set(id, now);
    e.replaceChildren(...build());
  }

  function show() {
    const body = document.body;
    body.dataset.state = status.state;
    body.dataset.canStart = status.can_start ? "yes" : "no";
    body.dataset.kind = status.kind || "walking";
    body.dataset.pulses = status.planned ? "yes" : "no";
    set("jz-study", status.study || "");
    set("jz-who", status.participant || "");
    const word = status.controller && status.state === "paused" ? "torque paused" : WORDS[status.state];
    set("jz-state", word || status.state);
    byId("jz-state").dataset.state = status.state;
    fill("jz-conditions", status.conditions, () => (status.conditions || []).map((one) => {
      const item = make("li", one.now ? "now" : one.done >= one.trials ? "done" : "", one.name);
      if (one.trials > 1) item.append(make("small", "", ` ${one.done}/${one.trials}`));
      return item;
    }));
    set("jz-doing", doing());
    set("jz-prompt", prompt());
    plan();
    estimates();
    figures();
    safety();
    told();
    controller();
    watchDevices();
    if (status.state !== unheardIn) alarm("unheard", "");
    alarm("problem", status.problem || "");
    alarm("silent", status.state === "silent"
      ? "The session writes no records: it has died or hangs. Use the emergency stop." : "");
  }

  function doing() {
    const name = status.condition || "";
    return {
      waiting: `Before “${name}”`, starting: "Devices are switched on", running: `“${name}” runs`,
      paused: `“${name}” runs, ${status.controller ? "without the controller's torque" : "no more pulses"} for now`, stopping: "Torque is taken away",
      stopped: `Stopped in “${name}”`, tripped: `Safety gate tripped in “${name}”`,
      failed: "The session ended before its end", writing: "The study is written",
      done: "The session is done", silent: "No records from the session", idle: "No session runs",
    }[status.state] || "";
  }

  function prompt() {
    if (["stopped", "tripped", "failed"].includes(status.state)) return ended();
    if (status.state === "idle") return status.words || "";
    if (status.state === "done") return "Analyse it with: jointz analyze";
    return status.prompt || "";
  }

  // Why it ended, and what its process said last: a re-arm that fails tells it there alone.
  function ended() {
    const reason = status.reason || "", words = status.words || "";
    if (reason && (words.includes(reason) || words.startsWith("jointz: Stopped."))) return reason;
    return [reason, words].filter(Boolean).join("  ")
      || "Its process is gone without a word: it was killed, or the computer lacked memory.";
  }

  // A card of bars and lines of text. What is there is changed, not made anew: ten times a second
  // new elements would keep the browser busy.
  function lines(id, items) {
    const e = byId(id);
    if (!e) return;
    const kinds = items.map((item) => (item.text === undefined ? "jz-bar" : "jz-small")).join();
    if (shown.get(id) !== kinds || e.childElementCount !== items.length) {
      shown.set(id, kinds);
      e.replaceChildren(...items.map((item) => (item.text === undefined ? emptyBar() : make("div", "jz-small"))));
    }
    items.forEach((item, k) => {
      const line = e.children[k];
      if (item.text !== undefined) { write(line, item.text); return; }
      line.className = `jz-bar ${item.kind || ""}`;
      write(line.children[0], item.name);
      write(line.children[1], item.value);
      line.children[2].firstChild.style.width = `${Math.max(0, Math.min(1, item.share || 0)) * 100}%`;
    });
  }

  function emptyBar() {
    const row = make("div", "jz-bar"), track = make("div", "jz-track");
    track.append(make("div", "jz-fill"));
    row.append(make("span", "jz-name"), make("span", "jz-value"), track);
    return row;
  }

  function pulseText(pulse) {
    const nm = pulse.amplitude_nm;
    const size = nm === 0 ? "sham" : `${nm > 0 ? "+" : "\u2212"}${Math.abs(nm)} N\u00b7m`;
    return [`newest pulse: ${pulse.number}`, pulse.shape, size, pulse.point && `at ${pulse.point}`].filter(Boolean).join(", ");
  }

  function plan() {
    const next = status.next, points = status.points || [], items = [];
    const banner = byId("jz-next");
    if (banner) {
      banner.hidden = !next;
      const n = next ? next.in_strides : 0;
      write(banner.children[0], next ? `next: ${next.point}` : "");
      write(banner.children[1], !next || n === undefined ? "" : n === 0 ? "this stride" : `in ${n} stride${n === 1 ? "" : "s"}`);
    }
    for (const point of points) {
      const name = point.pct === null ? point.name || "pulses" : `${point.name}  ${point.pct} %`;
      const kind = next && next.point === point.name ? "due" : "";
      items.push({ name, value: `${point.done} / ${point.planned}`, share: point.done / point.planned, kind });
    }
    if (!points.length && status.strides_planned) {
      const n = Math.min(status.strides || 0, status.strides_planned);
      items.push({ name: "strides", value: `${n} / ${status.strides_planned}`, share: n / status.strides_planned });
    }
    if (status.planned) {
      const again = status.missed + status.aborted;
      items.push({ text: `${status.done} of ${status.planned} pulses done`
        + (again ? `; ${status.missed} missed and ${status.aborted} broken off are done again` : "")
        + (status.withdrawn ? `; ${status.withdrawn} withdrawn: they move this knee too far` : "") });
    }
    if (status.newest_pulse) items.push({ text: pulseText(status.newest_pulse) });
    if (!items.length) items.push({ text: "nothing planned yet" });
    lines("jz-plan", items);
  }

  // How far the 95 % intervals of K, B and J reach by now, beside the half-widths that are wanted.
  function estimates() {
    const found = status.estimates || {}, values = found.values || [], items = [];
    document.body.dataset.estimates = found.problem || values.length ? "yes" : "no";
    for (const point of new Set(values.map((value) => value.timing_point))) {
      const own = values.filter((value) => value.timing_point === point);
      const wished = own.filter((value) => value.wish_pct !== null);
      const reached = (value) => (value.half_width_pct === null ? 0 : value.wish_pct / value.half_width_pct);
      items.push({
        name: `${point}  ${own[0].n_used} pulses`,
        value: own.map((value) => `${{ stiffness: "K", damping: "B", inertia: "J" }[value.parameter]} `
          + (value.half_width_pct === null ? "\u2013" : Math.round(value.half_width_pct))
          + (value.wish_pct === null ? "" : `/${Math.round(value.wish_pct)}`)).join("  "),
        share: wished.length ? Math.min(...wished.map(reached)) : 0,
        kind: wished.length && wished.some((value) => reached(value) < 1) ? "raised" : "",
      });
    }
    const wished = values.filter((value) => value.wish_pct !== null);
    const held = wished.filter((value) => value.half_width_pct !== null && value.half_width_pct <= value.wish_pct);
    const left = (status.planned || 0) - (status.done || 0);
    const minutes = found.minutes_per_pulse ? `, about ${Math.ceil(left * found.minutes_per_pulse)} min for the other ${left}` : "";
    if (wished.length) items.push({ text: `${held.length} of ${wished.length} wanted half-widths reached (after the slash)` });
    if (values.length) items.push({ text: `after ${found.n_pulses} pulses${minutes}` });
    for (const message of (found.messages || []).slice(0, 3)) items.push({ text: message });
    if (found.problem) items.push({ text: found.problem });
    lines("jz-estimates", items);
  }

  // ---------------------------------------------------------------- parameters of a controller
  const plain = (v) => (v === null || v === undefined ? "\u2013" : String(v).replace("-", "\u2212"));

  const breakable = (name) => name.replaceAll("_", "_\u200b"); // with lines that may break there

  function controller() {
    const runs = status.controller, card = byId("jz-controller");
    document.body.dataset.controller = runs && MOVES.has(status.state) ? "yes" : "no";
    const label = document.querySelector("#jz-pause .block");
    write(label, runs ? "Pause torque" : "Pause pulses");
    if (!runs || !card) return;
    const parameters = Object.entries(runs.parameters);
    const declared = parameters.map(([name, one]) => [name, one.low, one.high, one.rate_per_s, one.unit]);
    fill("jz-controller", [runs.name, declared], () => [
      controllerHead(runs.name), ...parameters.map(([name, one]) => parameterRow(name, one)),
    ]);
    parameters.forEach(([, one], k) => showParameter(card.children[k + 1], one));
    card.querySelectorAll("input, button").forEach((e) => { e.disabled = !listens(); });
  }

  function controllerHead(name) {
    const head = make("div", "jz-parameters-head"), button = make("button", "", "Undo (U)");
    button.type = "button";
    button.addEventListener("click", undo);
    head.append(make("span", "jz-title", "Controller"), make("b", "", breakable(name)), button);
    return head;
  }

  function parameterRow(name, one) {
    const row = make("form", "jz-parameter"), field = make("input"), button = make("button", "", "Set");
    const head = make("div"), unit = one.unit === "1" ? "" : one.unit.replaceAll("*", "\u00b7");
    head.append(make("b", "", breakable(name)), make("span", "jz-value"), make("span", "", unit));
    Object.assign(field, { type: "number", step: "any", ariaLabel: `${name}, ${unit || "no unit"}` });
    row.noValidate = true; // the session's answer says what is wrong
    row.addEventListener("submit", (event) => { event.preventDefault(); setParameter(name, field); });
    row.append(
      head, field, button,
      make("small", "", `${plain(one.low)} to ${plain(one.high)}, changes at most ${plain(one.rate_per_s)} per s`),
    );
    return row;
  }

  // A field that nobody has edited follows the value.
  function showParameter(row, one) {
    const [head, field] = row.children;
    write(head.children[1], plain(one.value));
    if (document.activeElement === field || field.value !== (field.dataset.shown || "")) return;
    field.value = one.value ?? "";
    field.dataset.shown = field.value;
  }

  const round = (v, digits = 0) => (v === null || v === undefined ? "\u2013" : v.toFixed(digits));
  const kindOf = (share) => (share > 0.9 ? "high" : share > 0.8 ? "raised" : "");

  function figures() {
    const loop = status.loop, device = status.device || {}, limits = status.limits || {};
    if (!loop) {
      lines("jz-loop", [{ text: "no records yet" }]);
      lines("jz-device", [{ text: "no records yet" }]);
      return;
    }
    const time = (name, us) => {
      const share = us / loop.period_us;
      return { name, value: `${round(us)} \u00b5s`, share, kind: kindOf(share) };
    };
    lines("jz-loop", [
      time("work of a tick, p99", loop.busy_p99_us), time("late, p99", loop.late_p99_us),
      time("late, most", loop.late_max_us),
      { text: `Last 10 s, against a slot of ${round(loop.period_us)} \u00b5s.` },
      { text: `${loop.missed_slots} of ${loop.ticks + loop.missed_slots} slots missed so far.`
        + (loop.damaged ? ` ${loop.damaged} records damaged.` : "") },
    ]);
    const gauge = (name, value, limit, unit, digits) => ({
      name, share: limit ? value / limit : 0, kind: limit ? kindOf(value / limit) : "",
      value: `${round(value, digits)}${limit ? ` / ${round(limit)}` : ""} ${unit}`,
    });
    lines("jz-device", limits.torque_nm === undefined ? [{ text: "not worn" }] : [
      gauge("winding", device.temperature_c, limits.temperature_c, "\u00b0C", 1),
      gauge("torque, peak", device.peak_sent_torque, limits.torque_nm, "N\u00b7m", 1),
      gauge("current, peak", device.peak_current, limits.current_a, "A", 1),
      gauge("velocity, peak", device.peak_velocity, limits.velocity_rad_s, "rad/s", 1),
      ...(status.kind === "control" ? []
        : [gauge("time under pulses", 100 * (device.pulse_duty || 0), 100 * limits.pulse_duty, "%", 0)]),
      { text: `supply ${round(device.voltage, 1)} V` },
    ]);
  }

  function safety() {
    const lit = status.flags || [], faults = status.faults || [];
    fill("jz-safety", [status.state, status.reason, lit, faults, status.without_console], () => {
      const made = [], lamps = make("div", "jz-lamps");
      const lamp = (name, kind) => lamps.append(make("span", `jz-lamp ${kind}`, name));
      const tripped = status.state === "tripped" || lit.includes("tripped");
      lamp(tripped ? "tripped" : "no trip", tripped ? "bad" : "good");
      for (const [flag, name] of [["clamped", "clamped"], ["fading", "fading"], ["cut", "pulse cut"], ["overrun", "slot missed"]]) {
        lamp(name, lit.includes(flag) ? "warn" : "");
      }
      for (const fault of faults) lamp(fault, "bad");
      made.push(lamps);
      if (tripped) made.push(make("div", "jz-trip", status.reason || ""));
      made.push(make("div", "jz-small", status.without_console === "stop"
        ? "Without this page the session stops." : "Without this page the session goes on."));
      return made;
    });
  }

  // What a live estimate decided about the pulses to come.
  function decision(event) {
    if (event.problem) return event.problem;
    if (event.stop) return "every wanted half-width is reached: no more pulses";
    const most = Object.entries(event.shares).sort((a, b) => b[1] - a[1]).slice(0, 2);
    const shares = most.map(([point, share]) => `${point} ${Math.round(100 * share)} %`);
    return most.length ? `of the next pulses ${shares.join(", ")}` : "go on as planned";
  }

  function told() {
    fill("jz-told", status.told, () => (status.told || []).slice(-30).reverse().map((event) => {
      const line = make("div", `jz-event ${event.event}`);
      const at = event.time_ns ? new Date(event.time_ns / 1e6).toLocaleTimeString([], { hour12: false }) : "";
      const words = event.event === "note" ? `“${event.text}”` : event.event.replaceAll("_", " ");
      const more = event.event === "prompted" ? event.condition
        : event.event.startsWith("parameter_") ? `${event.name}: ${plain(event.before)} \u2192 ${plain(event.after)}`
        : event.event === "decided" ? decision(event)
        : event.reason || (event.pulse ? `pulse ${event.pulse}` : event.order || "");
      line.append(make("time", "", at), make("b", "", words), make("span", "", more));
      return line;
    }));
  }

  function legend() {
    const controlled = status.kind === "control";
    fill("jz-legend", controlled, () => [
      ["angle", "joint angle"], ["command", controlled ? "controller's torque" : "pulse commanded"],
      ["sent", "sent to the device"], ["applied", "applied to the joint"],
      ...(controlled ? [] : [["pulse", "pulse"]]), ["heel", "heel strike"],
    ].map(([kind, text]) => {
      const item = make("span", `jz-key ${kind}`);
      item.append(make("i"), document.createTextNode(text));
      return item;
    }));
  }

  // ---------------------------------------------------------------- drawing
  function link() {
    const age = performance.now() - heard;
    const dead = age > 1500;
    const e = byId("jz-link");
    set("jz-link", dead ? "page lost the session" : "live");
    e.dataset.state = dead ? "failed" : "running";
    document.body.classList.toggle("jz-lost", dead);
    alarm("link", dead && heard > 0 ? "This page hears nothing. What it shows is old." : "");
  }

  let drawn = 0;
  function draw(at) {
    requestAnimationFrame(draw);
    if (at - drawn < 30) return; // 33 pictures a second are enough
    drawn = at;
    link();
    watchStop();
    legend();
    const flows = MOVES.has(status.state) && performance.now() - heard < 300;
    const now = flows ? Math.min(latest + 0.1, Math.max(latest - 0.1, performance.now() / 1000 + ahead)) : latest;
    jointzDraw.traces(rows, strikes, now);
    const phase = flows && rows.length ? rows[rows.length - 1][5] : null;
    const beat = strikes.length ? now - strikes[strikes.length - 1] : 9;
    jointzDraw.dial(phase, status.timing_points, status.next && status.next.point, status.strides || 0, beat, flows ? "no steady gait" : "");
    jointzDraw.onsets(status.onset_errors || []);
  }

  jointzDraw.refreshColours();
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", jointzDraw.refreshColours);
  window.addEventListener("load", () => { jointzDraw.refreshColours(); shown.clear(); if (status.state) show(); });
  // NiceGUI mounts its part late: words go in when their places are there.
  setInterval(() => { if (status.state) show(); }, 500);
  connect();
  requestAnimationFrame(draw);
  return { start, pause, goOn, note, rearm, stop };
})();
window.jointzConsole = jointzConsole;
