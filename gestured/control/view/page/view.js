"use strict";
// The page of `gesturectl view`.
const KEPT_S = 30, PATH_S = 3, CHART_S = 10, ROWS = 100;
const STEPS = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000, 1e6, 1e7, 1e9];
const PHASES = { IDLE: "idle", CONTACT: "contact", RELEASING: "releasing", GAP: "waiting for a second tap", SPENT: "held too long" };
const SHADES = { IDLE: "#8a94a0", CONTACT: "#e69f00", RELEASING: "#56b4e9", GAP: "#009e73", SPENT: "#cc79a7" }; // Okabe and Ito
const state = { stream: null, sensor: "", frames: [], full: 0, paused: false, moment: 0, dirty: false, drawn: 0, early: null };

for (const step of STEPS.slice(0, -2)) at("scale").append(new Option(`0 to ${step}`, step));

function clock(s) { return new Date(1000 * s).toLocaleTimeString("en-GB") + "." + String(Math.floor(s % 1 * 10)); }

const kinds = { sensors, frame, event, gone: gone => daemon(gone.reason, true) };

function open(sensor) {
  if (state.stream) state.stream.abort();
  state.frames = []; state.full = 0; state.sensor = sensor;
  state.stream = new AbortController();
  const query = new URLSearchParams({ sensor, raw: at("raw").checked ? "1" : "0" });
  listen("stream?" + query, state.stream.signal, kinds, reason => daemon(reason, true));
}

function daemon(text, gone) {
  at("state").textContent = text;
  at("state").classList.toggle("gone", gone);
}

function sensors(told) {
  daemon(`gestured ${told.version}, ${told.state}, model ${told.model}`, false);
  const names = Object.keys(told.sensors), select = at("sensor");
  at("sensors").tBodies[0].replaceChildren(...names.map(name => {
    const s = told.sensors[name];
    const tr = row([name, s.state + (s.touched ? ", touched" : "") + (s.closed?.length ? ", silent" : ""), s.rate_hz.toFixed(1), `${Math.round(1000 * s.jitter_s)} ms`, s.lost ?? 0, s.bad_taxels]);
    if (name === state.sensor) tr.className = "now";
    return tr;
  }));
  heard(told.sensors[state.sensor]);
  if (names.join("\n") !== [...select.options].map(o => o.value).join("\n")) {
    select.replaceChildren(...names.map(name => new Option(name, name, false, name === state.sensor)));
    if (!names.includes(state.sensor) && names.length) { select.value = names[0]; open(names[0]); }
  }
}

function listens(told) {
  if (told.closed?.length) return `silent, gates closed: ${told.closed.join(", ")}`;
  return told.armed === false ? "not armed" : told.armed ? "armed" : "listens";
}

function heard(told) { // what the sensor that is looked at listens to, as far as the daemon has said it
  at("listens").textContent = told ? listens(told) : "";
  at("gate").disabled = !told;
  at("gate").setAttribute("aria-checked", String(!told?.closed?.includes("view")));
}

function row(cells) {
  const tr = document.createElement("tr");
  for (const cell of cells) tr.insertCell().textContent = cell;
  return tr;
}

function frame(told) {
  const frames = state.frames;
  frames.push(told);
  while (frames.length && frames[0].time < told.time - KEPT_S) frames.shift();
  if (told.values) {
    const seen = Math.max(...told.values, 20 * told.noise);
    if (seen > state.full) state.full = STEPS.find(step => step >= seen) ?? seen;
  }
  if (!state.paused) plan();
}

function event(told) {
  const mine = told.sensor === state.sensor;
  const latency = "decided" in told && "offset" in told ? `${Math.round(1000 * (told.decided - told.offset))} ms` : "";
  let what = told.type;
  if (told.type === "gesture") what = words(told.gesture);
  if (told.type === "provisional") what = `probably ${words(told.gesture)}`;
  if (told.type === "unknown") what = told.reason ? `unknown: ${[told.reason, ...told.gates ?? []].join(" ")}` : "unknown";
  if (told.type === "gate") what = listens(told);
  if (told.type === "cancelled") what = `cancelled: ${told.reason}`;
  const verdict = told.provisional ? `; provisional ${told.provisional}` : ""; // confirmed, or revoked
  const time = told.decided ?? told.offset ?? told.onset ?? told.since ?? Date.now() / 1000;
  const body = at("events").tBodies[0];
  body.prepend(row([clock(time), told.sensor, what + verdict + (told.test ? " (test)" : ""), told.confidence === undefined ? "" : percent(told.confidence), latency]));
  while (body.rows.length > ROWS) body.deleteRow(-1);
  if (!mine) return;
  if (told.type === "gate") heard(told);
  if (told.type === "onset") { provisional("-", ""); at("answer").textContent = "..."; }
  if (told.type === "provisional") {
    state.early = told;
    provisional(`${words(told.gesture)}, ${percent(told.confidence)}`, "waiting");
  }
  if (told.provisional && state.early?.id === told.id) {
    const after = "decided" in told ? `; said ${Math.round(1000 * (told.decided - state.early.decided))} ms before the answer` : "";
    provisional(`${at("provisional").textContent}: ${told.provisional}${after}`, told.provisional);
  }
  if (told.type === "cancelled") at("answer").textContent = what;
  if (told.type === "gesture" || told.type === "unknown") {
    const answer = `${what}, ${percent(told.confidence)}`;
    at("answer").textContent = answer;
    at("said").textContent = `${answer}, after ${latency}`;
    scores(told.scores, told.type === "gesture" ? told.gesture : "");
  }
}

function provisional(text, how) {
  at("provisional").textContent = text;
  at("provisional").className = how;
}

function scores(found, answer) {
  const names = Object.keys(found).sort((a, b) => found[b] - found[a]);
  at("scores").tBodies[0].replaceChildren(...names.map(name => {
    const tr = row([words(name), ""]), meter = document.createElement("meter");
    meter.value = found[name];
    meter.setAttribute("aria-label", `score of ${words(name)}`);
    tr.cells[1].append(meter, ` ${percent(found[name])}`);
    if (name === answer) tr.className = "best";
    return tr;
  }));
}

// Drawing: once for each picture of the screen at the most, and always the newest, whatever has come meanwhile.

function plan() {
  if (!state.dirty) { state.dirty = true; requestAnimationFrame(draw); }
}

function shown() {
  const frames = state.frames, last = frames[frames.length - 1];
  if (!last || !state.paused) return frames.length - 1;
  let i = frames.length - 1;
  while (i > 0 && frames[i].time > state.moment) i--;
  return i;
}

function draw() {
  state.dirty = false;
  const i = shown(), now = state.frames[i];
  if (!now) return;
  at("phase").textContent = PHASES[now.phase] ?? now.phase;
  const full = Number(at("scale").value) || state.full || 100;
  at("full").textContent = `${full} counts`;
  matrix(now, i, full);
  chart(i);
  const last = state.frames[state.frames.length - 1].time;
  if (state.paused) at("when").value = now.time - last;
  at("ago").textContent = state.paused ? `${(last - now.time).toFixed(2)} s ago` : "now";
  state.drawn++;
}

function matrix(now, i, full) {
  const sent = at("raw").checked && now.raw;
  const [rows, columns] = sent ? now.raw_grid : now.grid;
  const canvas = at("matrix"), [g, width] = fit(canvas, Math.min(rows / columns, 1.6));
  const values = sent ? now.raw : now.values, side = Math.min(width / columns, canvas.height / rows), left = (width - side * columns) / 2;
  const label = at("counts").checked && side > 16 * devicePixelRatio;
  if (!values) { canvas.setAttribute("aria-label", "the idle sensor is being learned"); return; }
  // Counts as they were sent have a scale of their own: from the least of this frame.
  const least = sent ? Math.min(...values) : 0, bad = new Set(sent ? [] : now.bad);
  let best = 0;
  taxels(g, values, columns, side, left, least, full);
  values.forEach((value, n) => {
    if (value > values[best]) best = n;
    const x = left + side * (n % columns), y = side * Math.floor(n / columns);
    if (bad.has(n)) {
      g.strokeStyle = "#ff6e6e"; g.lineWidth = 2 * devicePixelRatio;
      g.strokeRect(x + 2, y + 2, side - 5, side - 5);
      g.beginPath(); g.moveTo(x + 2, y + 2); g.lineTo(x + side - 3, y + side - 3); g.moveTo(x + side - 3, y + 2); g.lineTo(x + 2, y + side - 3); g.stroke();
    }
    if (label) {
      g.fillStyle = colour((value - least) / full).reduce((a, b) => a + b) > 380 ? "#000" : "#fff";
      g.font = `${Math.max(9 * devicePixelRatio, side / 4)}px ui-monospace, monospace`;
      g.textAlign = "center"; g.textBaseline = "middle";
      g.fillText(String(Math.round(value)), x + side / 2, y + side / 2);
    }
  });
  if (!sent) path(g, now, i, side, left);
  const place = `row ${Math.floor(best / columns) + 1}, column ${best % columns + 1}`;
  canvas.setAttribute("aria-label", `${rows} by ${columns} taxels; strongest ${Math.round(values[best])} counts at ${place}; ${bad.size} bad taxels; ${now.centroid ? "touched" : "not touched"}`);
}

function path(g, now, i, side, left) {
  const spots = [];
  for (let n = i; n >= 0 && state.frames[n].time > now.time - PATH_S; n--) spots.push(state.frames[n]);
  g.lineCap = "round";
  const stroke = share => { // light on dark, so that it shows on every colour
    g.lineWidth = 5 * devicePixelRatio; g.strokeStyle = `rgb(0 0 0 / ${.6 * share})`; g.stroke();
    g.lineWidth = 2.5 * devicePixelRatio; g.strokeStyle = `rgb(255 255 255 / ${share})`; g.stroke();
  };
  for (let n = spots.length - 1; n > 0; n--) {
    const a = spots[n].centroid, b = spots[n - 1].centroid;
    if (!a || !b) continue;
    g.beginPath(); g.moveTo(left + side * (a[1] + .5), side * (a[0] + .5)); g.lineTo(left + side * (b[1] + .5), side * (b[0] + .5));
    stroke(1 - (now.time - spots[n - 1].time) / PATH_S);
  }
  if (now.centroid) {
    g.beginPath();
    g.arc(left + side * (now.centroid[1] + .5), side * (now.centroid[0] + .5), side / 3, 0, 7);
    stroke(1);
  }
}

function chart(i) {
  const canvas = at("activity"), [g, width, height] = fit(canvas, 0), style = getComputedStyle(document.body);
  const now = state.frames[i], strip = 14 * devicePixelRatio, low = Math.log10(.5), high = Math.log10(1000);
  const x = time => width * (1 - (now.time - time) / CHART_S);
  const y = value => (height - strip - 4) * (1 - (Math.log10(Math.max(value, .5)) - low) / (high - low));
  let first = i;
  while (first > 0 && state.frames[first - 1].time > now.time - CHART_S) first--;
  const part = state.frames.slice(first, i + 1);
  g.font = `${11 * devicePixelRatio}px system-ui`; g.fillStyle = style.getPropertyValue("--faint");
  for (const mark of [1, 10, 100, 1000]) { g.fillRect(0, y(mark), width, 1); g.fillText(String(mark), 2, y(mark) + (mark > 500 ? 12 : -2) * devicePixelRatio); }
  const line = (key, ink, dash, wide) => {
    g.strokeStyle = ink; g.setLineDash(dash.map(d => d * devicePixelRatio)); g.lineWidth = wide * devicePixelRatio; g.beginPath();
    part.forEach((f, n) => g[n ? "lineTo" : "moveTo"](x(f.time), y(f[key]))); g.stroke();
  };
  line("on", style.getPropertyValue("--bad"), [6, 4], 1.5);
  line("off", style.getPropertyValue("--bad"), [2, 3], 1.5);
  line("activity", style.getPropertyValue("--mark"), [], 2);
  g.setLineDash([]);
  part.forEach((f, n) => {
    const from = x(f.time), to = n + 1 < part.length ? x(part[n + 1].time) : width;
    g.fillStyle = SHADES[f.phase] ?? "#888";
    g.fillRect(from, height - strip, Math.max(to - from, 1), strip);
  });
  g.fillStyle = "#000"; g.textBaseline = "alphabetic"; g.textAlign = "left";
  let free = 0; // where the last word ends
  part.forEach((f, n) => {
    if (n && part[n - 1].phase === f.phase || f.phase === "IDLE" || x(f.time) < free) return;
    const word = f.phase.toLowerCase();
    g.fillText(word, x(f.time) + 2, height - 3 * devicePixelRatio);
    free = x(f.time) + g.measureText(word).width + 4;
  });
  canvas.setAttribute("aria-label", `activity ${now.activity.toFixed(1)}; a contact begins at ${now.on.toFixed(1)}, ends below ${now.off.toFixed(1)}; phase ${PHASES[now.phase] ?? now.phase}`);
}

// What the reader does.

function pause(on) {
  const last = state.frames[state.frames.length - 1];
  state.paused = on;
  state.moment = last ? last.time : 0;
  at("pause").setAttribute("aria-pressed", String(on));
  if (!on) at("when").value = 0;
  plan();
}

function step(frames) {
  if (!state.frames.length) return;
  if (!state.paused) pause(true);
  const i = Math.min(Math.max(shown() + frames, 0), state.frames.length - 1);
  state.moment = state.frames[i].time;
  plan();
}

async function act(path, what) {
  at("done").textContent = "...";
  const answer = await post(path, what);
  at("done").textContent = answer.error ?? answer.done;
}

at("sensor").onchange = () => open(at("sensor").value);
at("raw").onchange = () => open(state.sensor);
at("counts").onchange = at("scale").onchange = plan;
at("pause").onclick = () => pause(!state.paused);
at("back").onclick = () => step(-1);
at("on").onclick = () => step(1);
at("when").oninput = () => {
  const last = state.frames[state.frames.length - 1];
  if (!last) return;
  const ago = Number(at("when").value);
  if (!state.paused) pause(true);
  state.moment = last.time + ago;
  plan();
};
at("flag").onclick = () => act("flag", { note: at("note").value });
at("recalibrate").onclick = () => act("recalibrate", { sensor: state.sensor });
at("gate").onclick = () => {
  const silence = at("gate").getAttribute("aria-checked") === "true";
  const question = silence ? `Silence ${state.sensor}? No program hears a gesture of it until its gate "view" is opened.`
    : `Open the gate "view" of ${state.sensor}? Programs act on its gestures again, unless another gate is closed.`;
  if (confirm(question)) act(silence ? "silence" : "hear", { sensor: state.sensor });
};
addEventListener("resize", plan);
addEventListener("keydown", e => {
  if (e.ctrlKey || e.altKey || e.metaKey || /^(INPUT|SELECT|BUTTON)$/.test(e.target.tagName) && e.target.type !== "checkbox") return;
  const keys = { " ": () => pause(!state.paused), ArrowLeft: () => step(-1), ArrowRight: () => step(1), c: () => at("counts").click(), m: () => at("raw").click(), f: () => at("flag").click(), r: () => at("recalibrate").click(), h: () => at("gate").click() };
  const wanted = keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
  if (wanted && !(e.key === " " && e.target.type === "checkbox")) { e.preventDefault(); wanted(); }
});
enter().then(() => open(""), error => daemon(error.message, true));
