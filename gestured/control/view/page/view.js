"use strict";
// The page of `gesturectl view`.
const KEPT_S = 30, PATH_S = 3, CHART_S = 10, ROWS = 100, HOUR_S = 3600, OUTLIERS = .1; // of the frames, which do not stretch the scale
const STEPS = [...Array(54).keys()].map(n => Number(`${[1, 2, 5][n % 3]}e${Math.floor(n / 3) - 8}`)); // 1e-8 to 5e9
const NO_RECORDER = "To flag, start the daemon with --flight-recorder MIB: it keeps the last 30 s.";
const PHASES = { IDLE: "idle", CONTACT: "contact", RELEASING: "releasing", GAP: "waiting for a second tap", SPENT: "held too long" };
const OWN_KEYS = { text: /./, "select-one": /./, range: /^Arrow/, checkbox: / /, submit: / / }; // by type of what has the focus
const SHADES = { IDLE: "#8a94a0", CONTACT: "#e69f00", RELEASING: "#56b4e9", GAP: "#009e73", SPENT: "#cc79a7" }; // Okabe and Ito
const state = { stream: null, sensor: "", frames: [], full: 0, time: 0, paused: false, moment: 0, dirty: false, drawn: 0, lies: false, sliders: [] };
const counted = { since: Date.now() / 1000, times: {} }; // by sensor and type: when contacts were answered, s


for (const step of STEPS.filter(step => step >= .01 && step < 1e6)) at("scale").append(new Option(`0 to ${step}`, step));

function count(value) { // as exact as the scale shows it: a sensor may send fractions
  return String(Number(value.toFixed(Math.max(0, 1 - Math.floor(Math.log10(state.full || 100))))));
}

function clock(s) { return new Date(1000 * s).toLocaleTimeString("en-GB") + "." + String(Math.floor(s % 1 * 10)); }

const kinds = { sensors, frame, event, touch: told => state.sliders.forEach(follow => follow(told)), gone: gone => daemon(gone.reason, true) };

function open(sensor) {
  if (state.stream) state.stream.abort();
  state.frames = []; state.full = 0; state.sensor = sensor; state.lies = false;
  sessionStorage.setItem("sensor", sensor); // for when the page is loaded again
  pause(false);
  rest();
  forget();
  headline("…", "guess", "no contact yet");
  at("scores").tBodies[0].replaceChildren();
  state.stream = new AbortController();
  const query = new URLSearchParams({ sensor, raw: at("raw").checked ? "1" : "0" });
  listen("stream?" + query, state.stream.signal, kinds, reason => daemon(reason, true));
}

function daemon(text, gone) {
  status(text, gone);
  if (!gone) return;
  absent(true); rest(); heard(null, "");
  at("flag").disabled = true;
}

function rest() { state.sliders = [slider(at("absolute"), false), slider(at("relative"), true)]; } // no finger moves them

function absent(is) { document.body.classList.toggle("absent", is); } // what is shown is of before

function sensors(told) {
  daemon(`gestured ${told.version}, ${told.state}, model ${told.model}`, false);
  const names = Object.keys(told.sensors), select = at("sensor"), seen = names.includes(state.sensor) && told.sensors[state.sensor];
  at("sensors").tBodies[0].replaceChildren(...names.map(name => {
    const s = told.sensors[name];
    const tr = row([name, s.state + (s.touched ? ", touched" : "") + (s.closed?.length ? ", silent" : ""), s.rate_hz.toFixed(1), `${Math.round(1000 * s.jitter_s)} ms`, s.lost ?? 0, s.bad_taxels,
      ...["gesture", "unknown", "cancelled"].map(type => counts(name, type))]);
    if (name === state.sensor) tr.className = "now";
    return tr;
  }));
  heard(seen);
  over.zones = seen.zones ?? {};
  absent(!seen || seen.state === "stale" || seen.state === "no_data");
  const minutes = Math.round((Date.now() / 1000 - counted.since) / 60);
  at("since").textContent = minutes < 60 ? `since this page was opened, ${minutes} min ago` : "in the last hour";
  write("findings", ...told.findings.filter(f => !f.sensor || f.sensor === state.sensor).map(f => {
    const li = document.createElement("li"), what = document.createElement("strong");
    what.textContent = f.what;
    li.append(what, f.remedy && `\n${f.remedy}`);
    return li;
  }));
  at("flag").disabled = at("note").disabled = !told.flight_recorder;
  if (!told.flight_recorder) at("done").textContent ||= NO_RECORDER;
  else if (at("done").textContent === NO_RECORDER) at("done").textContent = "";
  const offered = seen || !state.sensor ? names : [state.sensor, ...names]; // a daemon that starts again has not heard it yet
  const texts = offered.map(name => names.includes(name) ? name : `${name} (not heard so far)`);
  if (texts.join("\n") !== [...select.options].map(o => o.text).join("\n"))
    select.replaceChildren(...offered.map((name, n) => new Option(texts[n], name, false, name === state.sensor)));
  if (!state.sensor && names.length) { select.value = names[0]; open(names[0]); }
}

function listens(told) {
  if (told.closed?.length) return `silent, gates closed: ${told.closed.join(", ")}`;
  return told.armed === false ? "not armed" : told.armed ? "armed" : "listens";
}

function heard(told, absent = state.sensor && "not heard so far") { // what the sensor that is looked at listens to
  write("listens", told ? listens(told) : absent);
  at("gate").disabled = at("recalibrate").disabled = !told;
  at("gate").setAttribute("aria-checked", String(!told?.closed?.includes("view")));
}

function counts(sensor, type) { // of the last hour
  const times = counted.times[`${sensor} ${type}`] ??= [];
  while (times[0] < Date.now() / 1000 - HOUR_S) times.shift();
  return times.length;
}

function row(cells) {
  const tr = document.createElement("tr");
  for (const cell of cells) tr.insertCell().textContent = cell;
  return tr;
}

function frame(told) {
  const frames = state.frames, last = frames.at(-1);
  if (last && (told.time < state.time || String(told.grid) !== String(last.grid))) { frames.length = 0; pause(false); } // the clock was set back, or another grid
  state.time = told.time;
  const middle = state.paused ? state.moment : told.time; // what is frozen stays
  if (told.time <= middle + KEPT_S) frames.push(told);
  while (frames.length && frames[0].time < middle - KEPT_S) frames.shift();
  if (told.values) {
    told.peak = Math.max(...told.values); // once for each frame: half a minute of a large grid has millions of counts
    const most = frames.filter(f => f.centroid && f.values).map(f => f.peak).sort((a, b) => a - b);
    const seen = Math.max(most[Math.floor((1 - OUTLIERS) * (most.length - 1))] ?? 0, 20 * told.noise);
    state.full = STEPS.find(step => step >= seen) ?? seen;
  }
  const lies = told.phase === "SPENT";
  if (lies && !state.lies) headline("something lies here", "unknown", "pressed for 5 s: it is learned after a second in which nothing moves on it");
  if (!lies && state.lies) headline("…", "guess", "what lay here was taken away, or learned");
  state.lies = lies;
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
  if (told.type in { gesture: 1, unknown: 1, cancelled: 1 } && !told.test) (counted.times[`${told.sensor} ${told.type}`] ??= []).push(Date.now() / 1000);
  if (!mine) return;
  if (told.type === "gate") heard(told);
  if (state.lies) return;
  name(told);
  if (told.scores) scores(told);
  if (told.where) place(told);
}

function scores(told) { // the best two gestures and what is none, in this order whatever their shares are
  const [[best, share], second] = Object.entries(told.scores).sort((a, b) => b[1] - a[1]);
  const known = told.own || !share ? 1 : Math.min(told.confidence / share, 1); // the scores are of what is a gesture
  const rows = [[best, share * known], ...(second ? [[second[0], second[1] * known]] : []), ["none of these", 1 - known]];
  if (told.own) rows[0] = [told.gesture, told.confidence];
  at("scores").tBodies[0].replaceChildren(...rows.map(([what, part]) => {
    const tr = row([words(what), ""]), meter = document.createElement("meter");
    meter.value = part;
    meter.setAttribute("aria-label", `share of ${words(what)}`);
    tr.cells[1].append(meter, ` ${percent(part)}`);
    if (what === (told.gesture ?? "none of these")) tr.className = "best";
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
  matrix(now, i, full);
  chart(i);
  if (state.paused) at("when").value = now.time - state.time;
  at("ago").textContent = state.paused ? `${(state.time - now.time).toFixed(2)} s ago` : "now";
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
  write("least", count(least));
  write("full", `${count(least + full)} counts`);
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
      g.fillText(count(value), x + side / 2, y + side / 2);
    }
  });
  const stroke = share => { // light on dark, so that it shows on every colour
    g.lineWidth = 5 * devicePixelRatio; g.strokeStyle = `rgb(0 0 0 / ${.6 * share})`; g.stroke();
    g.lineWidth = 2.5 * devicePixelRatio; g.strokeStyle = `rgb(255 255 255 / ${share})`; g.stroke();
  };
  if (!sent) {
    path(g, now, i, side, left, stroke);
    drawOver(g, rows, columns, side, left, now.time, stroke);
  }
  const place = `row ${Math.floor(best / columns) + 1}, column ${best % columns + 1}`;
  canvas.setAttribute("aria-label", `${rows} by ${columns} taxels; strongest ${count(values[best])} counts at ${place}; ${bad.size} bad taxels; ${now.centroid ? "touched" : "not touched"}`);
}

function path(g, now, i, side, left, stroke) {
  const spots = [];
  for (let n = i; n >= 0 && state.frames[n].time > now.time - PATH_S; n--) spots.push(state.frames[n]);
  g.lineCap = "round";
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
  const last = state.frames.at(-1);
  state.paused = on && last !== undefined;
  state.moment = last?.time;
  at("pause").setAttribute("aria-pressed", String(state.paused));
  if (!state.paused) at("when").value = 0;
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
  if (!state.frames.length) return;
  const ago = Number(at("when").value);
  if (!state.paused) pause(true);
  state.moment = state.time + ago;
  plan();
};
at("flag").onclick = e => { if (e.detail < 2) act("flag", { note: at("note").value }); }; // a double click is one flag
at("recalibrate").onclick = () => {
  const question = `Learn the idle sensor ${state.sensor} anew? It must not be touched for a second, and hears nothing meanwhile.`;
  if (confirm(question)) act("recalibrate", { sensor: state.sensor });
};
at("gate").onclick = () => {
  const silence = at("gate").getAttribute("aria-checked") === "true";
  const question = silence ? `Silence ${state.sensor}? No program hears a gesture of it until its gate "view" is opened.`
    : `Open the gate "view" of ${state.sensor}? Programs act on its gestures again, unless another gate is closed.`;
  if (confirm(question)) act(silence ? "silence" : "hear", { sensor: state.sensor });
};
addEventListener("resize", plan);
addEventListener("keydown", e => {
  if (e.repeat && !e.key.startsWith("Arrow")) return; // a key that is held asks once
  const own = e.target.closest(".scroll") ? /^Arrow| / : OWN_KEYS[e.target.type]; // what it does itself with a key
  if (e.ctrlKey || e.altKey || e.metaKey || own?.test(e.key)) return;
  const keys = { " ": () => pause(!state.paused), ArrowLeft: () => step(-1), ArrowRight: () => step(1), c: () => at("counts").click(), m: () => at("raw").click(), f: () => at("flag").click(), r: () => at("recalibrate").click(), h: () => at("gate").click() };
  const wanted = keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
  if (wanted) { e.preventDefault(); wanted(); }
});
enter().then(() => open(door.token ? "" : sessionStorage.getItem("sensor") ?? ""), error => daemon(error.message, true));
