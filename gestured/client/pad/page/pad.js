"use strict";
// The page of a pad: what touches it is told to the server, at most sixty times a second, one message after the other.
const MESSAGE_MS = 16, STILL_MS = 100, LOST_MS = 2000, TRAIL_MS = 700, SAMPLES = 60, SAID = 8, FULL = 1100; // counts of a firm touch
const KEYS = { "\n": "Keep, go on", r: "Repeat", d: "Discard", y: "Keep all the same", p: "Pause" };
const pad = at("pad"), down = new Map(), trail = [];
const state = { seat: null, waiting: [], flying: false, frame: null, stream: new AbortController(), drawn: 0, wrong: {} };

function over(told) { state.stream.abort(); lost(told.reason); }

function lost(reason) { state.seat = null; status(reason, true); }

function seat(told) {
  state.seat = told; state.waiting = []; down.clear();
  state.wrong = { touch: "", frames: "" };
  at("lead").hidden = !told.keys;
  at("name").parentElement.hidden = told.keys;
  at("told").textContent = "";
  found("touch", "");
}

function found(by, wrong) { // says what is wrong with one part, as long as it is; else where the frames go
  state.wrong[by] = wrong;
  const { grid, rate_hz, to, sensor } = state.seat, first = Object.values(state.wrong).find(Boolean);
  status(first ?? `${grid.join(" × ")} at ${rate_hz} Hz, to ${to} as ${sensor}`, Boolean(first));
}

function frame(told) {
  found("frames", told.wrong);
  state.frame = told;
  plan();
}

function event(told) {
  name(told);
  if (told.type !== "gesture" && told.type !== "unknown") return;
  const line = document.createElement("li");
  line.textContent = told.type === "gesture" ? `${words(told.gesture)}, ${percent(told.confidence)}` : "none of these";
  at("said").prepend(line);
  while (at("said").children.length > SAID) at("said").lastChild.remove();
}

function told(said) { // what a program that leads through recordings says
  at("told").textContent = (at("told").textContent + said.text).split("\n").slice(-8).join("\n");
  at("told").scrollTop = at("told").scrollHeight;
}

// Contacts: pointers, whatever they are.

function sample(e, pressure) {
  const box = pad.getBoundingClientRect(), share = (n, of) => Math.min(Math.max(n / of, 0), 1);
  const wide = e.width > 2 ? Math.max(e.width, e.height) / box.width : 0; // a mouse has a width of 1
  const place = [share(e.clientX - box.left, box.width), 1 - share(e.clientY - box.top, box.height)];
  return [e.pointerId, e.timeStamp / 1000, ...place, pressure, wide].map(n => Number(n.toFixed(4)));
}

function touched(e) {
  if (e.button > 0 || e.type === "pointermove" && !down.has(e.pointerId)) return;
  e.preventDefault();
  if (e.type === "pointerdown") pad.setPointerCapture(e.pointerId);
  const many = e.type === "pointermove" ? e.getCoalescedEvents?.() ?? [] : [];
  for (const part of many.length ? many : [e]) tell(sample(part, part.pressure || .5)); // 0: it cannot tell
}

function left(e) {
  if (!down.has(e.pointerId)) return;
  tell(sample(e, 0));
  down.delete(e.pointerId);
}

function tell(what) {
  down.set(what[0], what);
  state.waiting.push(what);
  trail.push([performance.now(), what]);
  send(); plan();
}

async function send() {
  if (state.flying || !state.waiting.length || !state.seat) return;
  state.flying = true;
  const begun = performance.now(), { seat } = state.seat, samples = state.waiting.splice(0, SAMPLES);
  const answer = await post("touch", { seat, sent: begun / 1000, samples }, AbortSignal.timeout(LOST_MS));
  if (state.seat?.seat === seat) {
    if (answer.lost) state.waiting.unshift(...samples); // else a finger that has left would touch the pad for ever
    found("touch", answer.error ?? "");
  }
  await new Promise(then => setTimeout(then, begun + (answer.lost ? STILL_MS : MESSAGE_MS) - performance.now()));
  state.flying = false;
  send();
}

setInterval(() => { // a finger that holds still is told, too: who says nothing touches nothing
  if (state.waiting.length) return;
  for (const [id, what] of down) { down.set(id, [id, performance.now() / 1000, ...what.slice(2)]); state.waiting.push(down.get(id)); }
  send();
}, STILL_MS);

// Drawing, once for each picture of the screen at the most.

function plan() {
  if (!state.dirty) { state.dirty = true; requestAnimationFrame(draw); }
}

function draw() {
  state.dirty = false;
  if (!state.seat) return;
  const [rows, columns] = state.seat.grid, ratio = Math.min(Math.max(rows / columns, .3), 1.5);
  fingers(ratio);
  const [g, width] = fit(at("matrix"), ratio), side = Math.min(width / columns, at("matrix").height / rows);
  if (state.frame) {
    taxels(g, state.frame.values, columns, side, (width - side * columns) / 2, 0, FULL);
    at("matrix").setAttribute("aria-label", `${rows} by ${columns} taxels, strongest ${Math.max(...state.frame.values)} counts`);
    state.drawn++;
  }
}

function fingers(ratio) {
  pad.style.setProperty("--ratio", ratio);
  const [g, width, height] = fit(pad, ratio), now = performance.now(), last = new Map();
  while (trail.length && trail[0][0] < now - TRAIL_MS) trail.shift();
  g.strokeStyle = g.fillStyle = getComputedStyle(pad).getPropertyValue("--mark");
  g.lineCap = "round"; g.lineWidth = 6 * devicePixelRatio;
  for (const [time, [id, , x, y, pressure]] of trail) {
    const from = last.get(id);
    g.globalAlpha = 1 - (now - time) / TRAIL_MS;
    if (from) { g.beginPath(); g.moveTo(...from); g.lineTo(x * width, (1 - y) * height); g.stroke(); }
    if (pressure) last.set(id, [x * width, (1 - y) * height]); else last.delete(id);
  }
  g.globalAlpha = 1;
  for (const [, , x, y] of down.values()) { g.beginPath(); g.arc(x * width, (1 - y) * height, 14 * devicePixelRatio, 0, 7); g.fill(); }
  if (trail.length) plan();
}

for (const [key, label] of Object.entries(KEYS)) {
  const button = document.createElement("button");
  button.textContent = label;
  button.onclick = () => post("key", { key });
  at("lead").lastElementChild.append(button);
}
addEventListener("keydown", e => { // as in the terminal, whose words name them
  const key = e.key === "Enter" ? "\n" : e.key;
  const own = e.key === "Enter" && e.target.tagName === "BUTTON"; // it presses its own
  if (state.seat?.keys && Object.hasOwn(KEYS, key) && !own && !e.repeat && !e.ctrlKey && !e.altKey && !e.metaKey) post("key", { key });
});
for (const kind of ["pointerdown", "pointermove"]) pad.addEventListener(kind, touched);
for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(kind, left);
pad.addEventListener("contextmenu", e => e.preventDefault());
addEventListener("resize", plan);
const kinds = { seat, frame, event, told, over };
enter().then(() => listen("stream", state.stream.signal, kinds, lost), error => status(error.message, true));
