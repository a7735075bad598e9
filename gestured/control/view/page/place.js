"use strict";
// Over the matrix: where the last answer was, the sensor's zones, and a further one that is pulled up with the mouse.
const SHOWN_S = 5; // for so long an answer is drawn
const over = { where: null, since: 0, zones: {}, pulled: null, pulls: false, edge: null }; // places are fractions, y upward

function forget() { // another sensor is looked at
  over.where = over.pulled = null; over.zones = {};
  at("where").textContent = "";
  tellZone();
}

function place(told) { // an answer of the sensor that is shown
  over.where = told.where; over.since = state.frames[state.frames.length - 1]?.time ?? 0; // as it is drawn
  const { start, end, way, pressure, contacts, zone } = told.where, spot = p => `${percent(p.x)}, ${percent(p.y)}`;
  at("where").textContent = `${way ? `From ${spot(start)} to ${spot(end)}` : `At ${spot(start)}`} from the left and from below; way ${way.toFixed(2)} of the shorter edge, `
    + `${count(pressure)} counts, ${contacts === 2 ? "two fingers" : "one finger"}${zone ? `, in the zone ${zone}` : ""}.`;
}

function drawOver(g, rows, columns, side, left, time, stroke) {
  const x = share => left + side * (share * (columns - 1) + .5), y = share => side * ((1 - share) * (rows - 1) + .5);
  over.edge = { rows, columns, side, left };
  g.font = `${12 * devicePixelRatio}px system-ui`; g.textAlign = "left"; g.textBaseline = "bottom";
  const across = share => share <= 0 ? left : share >= 1 ? left + side * columns : x(share); // to the sensor's own edges
  const upward = share => share <= 0 ? side * rows : share >= 1 ? 0 : y(share);
  for (const [name, [l, b, r, t]] of Object.entries(over.pulled ? { ...over.zones, "": over.pulled } : over.zones)) {
    const [west, south] = [across(l) + 2, upward(b) - 2], at = [west + 6 * devicePixelRatio, south - 6 * devicePixelRatio];
    g.beginPath(); g.rect(west, south, across(r) - 2 - west, upward(t) + 2 - south); stroke(1);
    g.strokeText(name, ...at); g.fillStyle = "#000"; g.fillText(name, ...at); // dark on a light seam
  }
  if (!over.where || time < over.since || time > over.since + SHOWN_S) return;
  const { start, end } = over.where;
  g.beginPath(); g.arc(x(start.x), y(start.y), side / 4, 0, 7); stroke(1);
  g.setLineDash([side / 5, side / 4]); g.beginPath(); g.moveTo(x(start.x), y(start.y)); g.lineTo(x(end.x), y(end.y)); stroke(1); g.setLineDash([]);
  g.beginPath(); g.arc(x(end.x), y(end.y), side / 4, 0, 7); stroke(1); g.fillStyle = "#000"; g.fill();
}

function fraction(e) { // where the mouse is
  const box = at("matrix").getBoundingClientRect(), { rows, columns, side, left } = over.edge, scale = at("matrix").width / box.width;
  const share = (pixels, count) => Math.min(Math.max((pixels / side - .5) / (count - 1), 0), 1);
  return [share((e.clientX - box.left) * scale - left, columns), 1 - share((e.clientY - box.top) * scale, rows)]
    .map(value => Math.round(100 * value) / 100);
}

function tellZone() {
  const zone = over.pulled, name = at("zone-name").value;
  at("pulled").hidden = !zone;
  if (!zone) return;
  at("zone").textContent = `[sensors.${state.sensor}.zones.${name}]\nat = [${zone.join(", ")}]\n`;
  const other = Object.keys(over.zones).filter(key => [0, 1].every(k => over.zones[key][k] < zone[k + 2] && zone[k] < over.zones[key][k + 2]));
  at("zone-note").textContent = other.length ? `It overlaps ${other.join(", ")}: zones must share no place.`
    : Object.hasOwn(over.zones, name) ? `A zone is named ${name} already.`
    : /^[\w-]{1,64}$/.test(name) ? "" : "A name has 1 to 64 of A-Z, a-z, 0-9, _ and -.";
}

at("matrix").onpointerdown = e => {
  if (e.pointerType === "touch" || e.button || !over.edge || at("raw").checked) return; // a finger scrolls the page
  at("matrix").setPointerCapture(e.pointerId);
  over.pulls = fraction(e);
};
at("matrix").onpointermove = e => {
  if (!over.pulls) return;
  const here = fraction(e), [low, high] = [Math.min, Math.max].map(of => here.map((value, k) => of(value, over.pulls[k])));
  over.pulled = low.every((value, k) => value < high[k]) ? [...low, ...high] : null;
  tellZone();
  plan();
};
at("matrix").onpointerup = at("matrix").onpointercancel = () => { over.pulls = false; };
at("zone-name").oninput = tellZone;
at("copy").onclick = () => navigator.clipboard.writeText(at("zone").textContent).then(
  () => { at("zone-note").textContent = "Copied: put it into the configuration, and reload."; },
  () => { at("zone-note").textContent = "The browser does not let this page copy: mark the lines and copy them."; });
