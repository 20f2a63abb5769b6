// Draws on canvases what the console knows. Nothing here talks to anybody.
"use strict";

const jointzDraw = (() => {
  const WINDOW_S = 10;
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  let colours = {};
  const NAMES = ["text", "muted", "line", "card", "angle", "command", "sent", "applied", "pulse", "ok"];

  function refreshColours() {
    colours = Object.fromEntries(NAMES.map((name) => [name, style(`--jz-${name}`)]));
  }

  // A canvas as sharp as the screen; null while there is none or it has no size.
  function surface(id) {
    const canvas = document.getElementById(id);
    if (!canvas || !canvas.clientWidth || !canvas.clientHeight) return null;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    return { pen, width, height };
  }

  // Round limits about what is shown, never narrower than `least`.
  function limits(rows, columns, least, from) {
    let [low, high] = least;
    for (let i = from; i < rows.length; i++) {
      for (const k of columns) {
        const v = rows[i][k];
        if (v === null) continue;
        if (v < low) low = v;
        if (v > high) high = v;
      }
    }
    return [low, high];
  }

  function lane(pen, box, [low, high], step, label) {
    const y = (v) => box.y + box.h - ((v - low) / (high - low)) * box.h;
    pen.strokeStyle = colours.line;
    pen.fillStyle = colours.muted;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) {
      pen.beginPath();
      pen.moveTo(box.x, y(v));
      pen.lineTo(box.x + box.w, y(v));
      pen.stroke();
      pen.fillText(String(Math.round(v * 10) / 10), box.x - 8, y(v));
    }
    pen.textAlign = "left";
    pen.textBaseline = "top";
    pen.fillText(label, box.x + 4, box.y + 2);
    return y;
  }

  function curve(pen, rows, from, column, x, y, look) {
    pen.strokeStyle = look.colour;
    pen.lineWidth = look.width;
    pen.setLineDash(look.dash || []);
    pen.lineJoin = "round";
    pen.beginPath();
    let down = false;
    for (let i = from; i < rows.length; i++) {
      const v = rows[i][column];
      if (v === null) { down = false; continue; }
      const at = [x(rows[i][0]), y(look.scale ? v * look.scale : v)];
      if (down) pen.lineTo(...at); else pen.moveTo(...at);
      down = true;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  function step(range) {
    for (const s of [1, 2, 5, 10, 20, 50, 100]) if (range / s <= 6) return s;
    return 200;
  }

  function traces(rows, strikes, now) {
    const on = surface("jz-traces");
    if (!on) return;
    const { pen, width, height } = on;
    const left = 44, right = 10, gap = 12, foot = 20;
    const room = height - gap - foot - 6;
    const top = { x: left, y: 6, w: width - left - right, h: room * 0.44 };
    const low = { x: left, y: 6 + top.h + gap, w: top.w, h: room * 0.56 };
    const x = (t) => left + top.w - ((now - t) / WINDOW_S) * top.w;
    let from = rows.findIndex((row) => row[0] >= now - WINDOW_S);
    if (from < 0) from = rows.length;
    pen.save();
    pulses(pen, rows, from, x, top.y, low.y + low.h - top.y, left);
    pen.restore();
    const degrees = 180 / Math.PI;
    const angles = limits(rows, [1], [-0.1, 1.2], from).map((v) => v * degrees);
    const yAngle = lane(pen, top, angles, 20, "angle, degrees");
    const torque = limits(rows, [2, 3, 4], [-5, 20], from);
    const yTorque = lane(pen, low, [torque[0] - 1, torque[1] + 1], step(torque[1] - torque[0]), "torque, N·m");
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, top.w, height);
    pen.clip();
    curve(pen, rows, from, 1, x, yAngle, { colour: colours.angle, width: 2, scale: degrees });
    curve(pen, rows, from, 2, x, yTorque, { colour: colours.command, width: 5 });
    curve(pen, rows, from, 4, x, yTorque, { colour: colours.applied, width: 1.6 });
    curve(pen, rows, from, 3, x, yTorque, { colour: colours.sent, width: 1.6, dash: [5, 3] });
    heels(pen, strikes, x, top.y, low.y + low.h);
    pen.restore();
    seconds(pen, x, now, low.y + low.h, left);
  }

  function pulses(pen, rows, from, x, y, h, left) {
    pen.fillStyle = colours.pulse;
    for (let i = from; i < rows.length; i++) {
      if (!rows[i][6]) continue;
      const begin = i;
      while (i + 1 < rows.length && rows[i + 1][6] === rows[begin][6]) i++;
      const a = Math.max(left, x(rows[begin][0])), b = x(rows[i][0]);
      pen.fillRect(a, y, Math.max(2, b - a), h);
    }
  }

  function heels(pen, strikes, x, top, bottom) {
    pen.strokeStyle = colours.muted;
    pen.fillStyle = colours.muted;
    pen.lineWidth = 1;
    for (const at of strikes) {
      pen.globalAlpha = 0.55;
      pen.setLineDash([2, 4]);
      pen.beginPath();
      pen.moveTo(x(at), top);
      pen.lineTo(x(at), bottom);
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = 1;
      pen.beginPath();
      pen.moveTo(x(at) - 5, bottom + 8);
      pen.lineTo(x(at) + 5, bottom + 8);
      pen.lineTo(x(at), bottom);
      pen.fill();
    }
  }

  function seconds(pen, x, now, y, left) {
    pen.fillStyle = colours.muted;
    pen.textBaseline = "top";
    pen.textAlign = "center";
    for (let t = 2 * Math.ceil((now - WINDOW_S) / 2); t <= now; t += 2) {
      if (t >= 0 && x(t) > left + 12) pen.fillText(`${t} s`, x(t), y + 9);
    }
  }

  function dial(phase, points, next, strides, beat, unknown) {
    const on = surface("jz-dial");
    if (!on) return;
    const { pen, width, height } = on;
    const cx = width / 2, cy = height / 2, r = Math.min(width / 2 - 34, height / 2 - 20);
    const angle = (pct) => (pct / 100) * 2 * Math.PI - Math.PI / 2;
    pen.lineWidth = 12;
    pen.strokeStyle = colours.line;
    ring(pen, cx, cy, r, 0, 100, angle);
    if (phase !== null) {
      pen.strokeStyle = colours.angle;
      ring(pen, cx, cy, r, 0, Math.max(phase, 0.01), angle);
    }
    for (const [name, pct] of Object.entries(points || {})) {
      const due = name === next;
      const [px, py] = [cx + r * Math.cos(angle(pct)), cy + r * Math.sin(angle(pct))];
      pen.fillStyle = due ? colours.sent : colours.card;
      pen.strokeStyle = due ? colours.sent : colours.muted;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(px, py, due ? 7 : 5, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
      pen.fillStyle = due ? colours.sent : colours.muted;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(name, cx + (r + 22) * Math.cos(angle(pct)), cy + (r + 15) * Math.sin(angle(pct)));
    }
    // The heel: full when it has just struck.
    pen.fillStyle = colours.text;
    pen.globalAlpha = Math.max(0.25, 1 - beat / 0.4);
    pen.beginPath();
    pen.moveTo(cx - 7, cy - r - 15);
    pen.lineTo(cx + 7, cy - r - 15);
    pen.lineTo(cx, cy - r - 4);
    pen.fill();
    pen.globalAlpha = 1;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = colours.text;
    pen.font = "600 30px system-ui, sans-serif";
    pen.fillText(phase === null ? "–" : `${Math.round(phase)} %`, cx, cy - 8);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = colours.muted;
    pen.fillText(phase === null ? unknown : `${strides} strides`, cx, cy + 16);
  }

  function ring(pen, cx, cy, r, from, to, angle) {
    pen.beginPath();
    pen.arc(cx, cy, r, angle(from), angle(to));
    pen.stroke();
  }

  function onsets(errors) {
    const on = surface("jz-onsets");
    if (!on) return;
    const { pen, width, height } = on;
    const span = 8, bins = 32, bottom = height - 20;
    const counts = new Array(bins).fill(0);
    for (const e of errors) {
      const k = Math.floor(((e.error_pct + span) / (2 * span)) * bins);
      counts[Math.min(bins - 1, Math.max(0, k))]++;
    }
    const most = Math.max(4, ...counts), x = (v) => 6 + ((v + span) / (2 * span)) * (width - 12);
    pen.fillStyle = colours.angle;
    counts.forEach((n, k) => {
      const h = (n / most) * (bottom - 24);
      const a = x(-span + (k * 2 * span) / bins), b = x(-span + ((k + 1) * 2 * span) / bins);
      if (n) pen.fillRect(a + 1, bottom - h, b - a - 2, h);
    });
    pen.strokeStyle = colours.muted;
    pen.beginPath();
    pen.moveTo(6, bottom + 0.5);
    pen.lineTo(width - 6, bottom + 0.5);
    pen.stroke();
    pen.setLineDash([3, 3]);
    pen.beginPath();
    pen.moveTo(x(0), 20);
    pen.lineTo(x(0), bottom);
    pen.stroke();
    pen.setLineDash([]);
    pen.fillStyle = colours.muted;
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const v of [-8, -4, 0, 4, 8]) pen.fillText(String(v), Math.min(Math.max(x(v), 10), width - 10), bottom + 5);
    pen.textAlign = "left";
    pen.fillStyle = errors.length ? colours.text : colours.muted;
    pen.fillText(summary(errors), 4, 2);
  }

  function summary(errors) {
    const n = errors.length;
    if (!n) return "no pulse in a whole stride yet";
    const mean = errors.reduce((sum, e) => sum + e.error_pct, 0) / n;
    if (n < 2) return `n = 1, ${mean.toFixed(1)}`;
    const spread = Math.sqrt(errors.reduce((sum, e) => sum + (e.error_pct - mean) ** 2, 0) / (n - 1));
    return `n = ${n}, mean ${mean.toFixed(1)}, SD ${spread.toFixed(1)}`;
  }

  return { refreshColours, traces, dial, onsets, WINDOW_S };
})();
