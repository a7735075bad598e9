"use strict";
// What the pages of gestured share. What comes from a server is written by textContent alone: a name is never markup.
const at = id => document.getElementById(id);
const CIVIDIS = ["#00204d", "#31446b", "#666970", "#958f78", "#cab969", "#ffea46"];
const SILENT_MS = 12000, MUTE = "the program that serves this page does not answer: does it still run?";
const dark = matchMedia("(prefers-color-scheme: dark)");
const door = { secret: sessionStorage.getItem("secret") ?? "", token: location.hash.slice(1) };
let stops; // colours from nothing, which is the page's own ground, to the most
history.replaceState(null, "", "/"); // the token works once: for a secret that this tab keeps, and no other origin can read

function words(name) { return String(name).replaceAll("_", " "); }
function percent(share) { return `${Math.round(100 * share)} %`; }

function write(id, ...parts) { // what is written again is read aloud again, and can no longer be marked: only if it differs
  const place = at(id), fresh = place.cloneNode();
  fresh.append(...parts);
  if (!fresh.isEqualNode(place)) place.replaceChildren(...parts);
}

function status(text, gone) {
  write("state", text);
  at("state").classList.toggle("gone", gone);
}

async function ask(path, more) {
  return fetch(path, { ...more, headers: { "X-Gestured-Token": door.secret, ...more?.headers } });
}

async function post(path, what, signal) {
  return ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(what), signal })
    .then(r => r.json()).catch(() => ({ error: MUTE, lost: true }));
}

async function enter() { // by the token, else by the secret that this tab has kept; throws the reason where the door is closed
  let told;
  for (const key of new Set([door.token || door.secret, door.secret])) {
    door.secret = key;
    if (!(told = await post("open", {})).error) break;
  }
  if (told.error) throw new Error(told.error);
  sessionStorage.setItem("secret", door.secret = told.secret);
}

async function listen(path, signal, hear, lost) { // server-sent events; EventSource sends no header
  let late = null;
  signal.addEventListener("abort", () => late?.abort()); // browsers before 2024 have no AbortSignal.any
  while (!signal.aborted) {
    let busy = "";
    late = new AbortController();
    const soon = what => { // a server that lives says so each 5 s
      const timer = setTimeout(() => late.abort(), SILENT_MS);
      return what.finally(() => clearTimeout(timer));
    };
    try {
      const answer = await soon(ask(path, { signal: late.signal }));
      if (answer.status === 503) throw new Error(busy = await answer.text()); // there is no place now
      if (!answer.ok) { lost(await answer.text()); return; }
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      for (let rest = "", part; !(part = await soon(reader.read())).done;) {
        const blocks = (rest + part.value).split("\n\n");
        rest = blocks.pop();
        for (const block of blocks) {
          const told = /^event: (\w+)\ndata: (.*)$/.exec(block);
          if (told && !signal.aborted) hear[told[1]]?.(JSON.parse(told[2]));
        }
      }
    } catch { /* it has gone, or something else is looked at */ }
    if (signal.aborted) return;
    lost(busy || MUTE);
    await new Promise(again => setTimeout(again, 1000));
  }
}

// The name of a contact, first and largest: grey while it is a guess, solid when it is said, struck where it is revoked.
let guess = null;

function headline(text, how, ...notes) {
  at("name").replaceChildren(text);
  at("name").className = how;
  at("name-note").textContent = notes.filter(Boolean).join(", ");
}

function name(told) { // an event of the sensor that is shown
  const ms = (from, to) => `${Math.round(1000 * (to - from))} ms`;
  if (told.type === "onset") { guess = null; headline("…", "guess", "touched"); }
  if (told.type === "provisional") {
    guess = told;
    headline(words(told.gesture), "guess", "a guess", percent(told.confidence), `${ms(told.onset, told.decided)} after it began`);
  }
  if (told.type === "cancelled") headline("no answer", "unknown", words(told.reason));
  if (told.type !== "gesture" && told.type !== "unknown") return;
  const guessed = told.provisional && guess?.id === told.id ? guess : null;
  const said = told.type === "gesture";
  headline(said ? words(told.gesture) : "none of these", told.type, said ? percent(told.confidence) : words([told.reason ?? "", ...told.gates ?? []].join(" ")),
    `${ms(told.offset, told.decided)} after the finger left`, guessed && `${told.provisional}, ${ms(guessed.decided, told.decided)} after the guess`);
  if (told.provisional === "revoked" && guessed) {
    const struck = document.createElement("s");
    struck.textContent = words(guessed.gesture);
    at("name").prepend(struck, " ");
  }
}

function fit(canvas, ratio) { // its drawing ground, as fine as the screen; the height follows the width where a ratio is given
  const width = Math.round(canvas.clientWidth * devicePixelRatio);
  const height = Math.round((ratio ? canvas.clientWidth * ratio : canvas.clientHeight) * devicePixelRatio);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width; canvas.height = height;
    if (ratio) canvas.style.height = `${canvas.clientWidth * ratio}px`;
  }
  const g = canvas.getContext("2d");
  g.clearRect(0, 0, width, height);
  return [g, width, height];
}

function colours() { // lighter is more on a dark page, darker on a light one
  const ground = getComputedStyle(document.documentElement).getPropertyValue("--panel").trim();
  const rest = dark.matches ? CIVIDIS.slice(1) : [...CIVIDIS].reverse();
  stops = [ground, ...rest].map(c => [1, 3, 5].map(i => parseInt(c.slice(i, i + 2), 16)));
  document.documentElement.style.setProperty("--scale", `linear-gradient(90deg, ${[ground, ...rest].join(", ")})`);
}

function colour(share) {
  const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1), i = Math.min(Math.floor(place), stops.length - 2);
  return stops[i].map((low, c) => Math.round(low + (stops[i + 1][c] - low) * (place - i)));
}

function taxels(g, values, columns, side, left, least, full) { // with lines between them, since an idle one has the page's colour
  const line = Math.min(1, side / 10);
  g.fillStyle = getComputedStyle(document.body).getPropertyValue("--line");
  g.fillRect(left, 0, side * columns, side * values.length / columns);
  values.forEach((value, n) => {
    g.fillStyle = `rgb(${colour((value - least) / full).join(" ")})`;
    g.fillRect(left + side * (n % columns), side * Math.floor(n / columns), side - line, side - line);
  });
}

colours();
dark.addEventListener("change", () => { colours(); plan(); });
addEventListener("hashchange", () => { // another address of this page, as of a program that was started again
  if (location.hash && !at(location.hash.slice(1))) location.reload();
});
