// Plots of the last minute, simulated, of all that the page knows; numbers are kept only while the card is open.

import { listen, value } from "./channel.js";
import { section } from "./dom.js";

const SPAN = 60; // what is kept [s]
const PERIOD = 50, REDRAWN = 100; // [ms]
const PLACES = { "/effector": "effector", "/ball": "ball", "/target": "target" };
const BALL_FORCE = "ball, contact force";
const AXES = ["x", "y", "z"];
const ENERGIES = { kinetic: "kinetic", strain: "strain", gravity: "gravity", work: "work of the servos", lost: "lost" };

const PARTS = ["kinetic", "strain", "gravity"]; // of the total energy

const jointKinds = () => (value("scene")?.joints ? value("kinds") ?? [] : []);
const fieldOf = (field) => value("fields")?.find(({ name }) => name === field) ?? { label: field, unit: "" };

// What can be plotted now, each [title, name, unit, value, group of the list, whether it is listed before it is known];
// `view`: of the scene, or null.
function quantities(view) {
  const run = value("run"), figures = value("figures"), joints = value("joints"), found = [];
  let group = "joints";
  const add = (title, name, unit, number, factor = 1, listed = false) => found.push([title, name, unit, factor * (number ?? NaN), group, listed]);
  jointKinds().forEach(({ name, unit, back, servo }, i) => {
    const title = servo ? "servo angles" : `actuators [${unit}]`;
    add(title, name, unit, joints?.angles?.[i]);
    add(`${title}, commanded`, name, unit, joints?.asked?.[i]);
    add(servo ? "servo torques" : `in return [${back}]`, name, back, joints?.torques?.[i]);
  });
  if (value("scene")?.slide_max) add("slide", "slide", "mm", joints?.slide);
  for (const [path, name] of Object.entries(PLACES)) {
    const place = view?.placeOf(path);
    group = name;
    if (place) AXES.forEach((axis, a) => add(name, axis, "mm", place[a], 1e3));
  }
  group = "ball";
  const ball = view?.ball();
  if (ball?.place) {
    add("ball, speed", "speed", "mm/s", ball.speed, 1e3);
    add(BALL_FORCE, "contact force", "N", ball.force, 1, true);
  }
  group = "energies";
  const energy = figures?.energy ?? {}, total = PARTS.reduce((sum, part) => sum + (energy[part] ?? NaN), 0);
  add("energies", "total", "mJ", total, 1e3);
  for (const [key, name] of Object.entries(ENERGIES)) add("energies", name, "mJ", energy[key], 1e3);
  group = "timing";
  add("real-time factor", "simulated / real time", "", run?.factor);
  add("time of a step", "median", "ms", run?.step, 1e3);
  add("time of a step", "p99", "ms", run?.p99, 1e3);
  group = "errors";
  add("residual", "residual", "N", figures?.residual);
  add("halvings", "steps halved", "", figures?.halvings);
  add("stability margin", "least", "", figures?.stability_margin?.[0]);
  add("estimated errors", "time steps", "mm", run?.time_error, 1e3);
  add("estimated errors", "time steps at the effector", "mm", run?.effector_time_error, 1e3);
  group = "contact";
  add("contact", "pairs near each other", "", figures?.contacts);
  add("contact", "pairs that press", "", figures?.pressed);
  add("contact distances", "smallest gap", "mm", figures?.smallest_gap, 1e3);
  add("contact distances", "penetration", "mm", figures?.penetration, 1e3);
  add("contact distances", "error", "mm", figures?.contact_error, 1e3);
  group = "forces";
  for (const { name, unit, largest, longest } of view?.groups() ?? []) if (longest) add(`largest [${unit}]`, name, unit, largest);
  for (const { name, part, node } of picked) {
    const title = `${name}, node ${node}`, place = view.vertex(part, node), rest = place && view.rest(part, node);
    group = title;
    AXES.forEach((axis, a) => add(title, axis, "mm", place?.[a], 1e3));
    for (const [field, number] of place ? view.fieldsAt(part, node) : []) {
      const { label, unit } = fieldOf(field);
      add(`${title}, ${label}`, label, unit, number);
    }
    if (rest) add(`${title}, moved`, "displacement", "mm", Math.hypot(...place.map((v, a) => v - rest[a])), 1e3);
  }
  return found;
}

// Numbers by series and simulated time, as `plot.js` takes them.
class Minute {
  constructor() {
    Object.assign(this, { times: [], columns: new Map() });
    this.clock = this.column("page time", "s");
  }

  get lists() { return [this.times, this.clock.values, ...[...this.columns.values()].map(({ values }) => values)]; }

  empty() { for (const list of this.lists) list.length = 0; }

  get length() { return this.times.length; }
  get start() { return this.times[0] ?? 0; }
  get end() { return this.times[this.length - 1] ?? 0; }

  at(time) {
    const after = this.times.findIndex((t) => t > time);
    return [after < 0 ? Math.max(this.length - 1, 0) : Math.max(after - 1, 0)];
  }

  column(name, unit) {
    const values = this.times.map(() => NaN);
    return { name, unit, values, at: (i) => values[i] };
  }

  // Adds the numbers at a time, unless that is there; after a reset, with which time goes back, the curves start again.
  // `found`: as `quantities` returns it; `made`: called with each quantity that is new.
  add(time, clock, found, made) {
    if (time < this.end) this.empty();
    if (this.length && time === this.end) return;
    for (const [title, name, unit, number, group, listed] of found) {
      const key = `${title}: ${name}`;
      if (this.columns.has(key) || !(listed || Number.isFinite(number))) continue;
      this.columns.set(key, this.column(name, unit));
      made(title, name, unit, this.columns.get(key).at, group);
    }
    const now = new Map(found.map(([title, name, , number]) => [`${title}: ${name}`, number]));
    this.times.push(time);
    this.clock.values.push(clock);
    for (const [key, { values }] of this.columns) values.push(now.get(key) ?? NaN);
    const old = this.times.findIndex((t) => t >= time - SPAN);
    if (old > 0) for (const list of this.lists) list.splice(0, old);
  }
}

const picked = []; // nodes that are plotted: name, part, node

// The card; `view`: of the scene, or null. Returns it, and `plotNode`, which plots a node of a body.
export function plots(view) {
  const card = section("plots", "Plots", [], false), minute = new Minute();
  let timer = 0, drawn = 0, held = null, wanted = [];
  const all = new Plots(card, minute, (time) => { held = time; });
  for (const name of ["pointerup", "pointerleave"]) all.box.addEventListener(name, () => { held = null; });

  // What is shown at first: the joints, or the energies; and how fast it goes.
  function begin() {
    const kinds = jointKinds();
    const titles = [...new Set(kinds.map(({ servo, unit }) => (servo ? "servo angles" : `actuators [${unit}]`)))];
    wanted = [...(titles.length ? titles : ["energies"]), "real-time factor"];
  }

  // Whether there is something of that title to be shown.
  function show(title) {
    const series = [...all.series].filter(([key]) => key.startsWith(`${title}: `)).map(([, s]) => s);
    if (series.length) all.show(title.replace(/ \[.*\]$/, ""), series);
    return series.length > 0;
  }

  // Whether a plot that is seen needs the forces, which the simulator computes on request.
  const needForces = () => card.open && all.plots.some(({ series }) => series.some(({ title, group }) => title === BALL_FORCE || group === "forces"));

  function sample() {
    view?.plotForces(needForces());
    if (!value("scene") || document.body.classList.contains("past")) return;
    const now = performance.now(), before = all.series.size, time = Number.isFinite(view?.time) ? view.time : value("run")?.time;
    if (!Number.isFinite(time)) return;
    minute.add(time, now / 1e3, quantities(view), (...quantity) => all.offer(...quantity));
    wanted = wanted.filter((title) => !show(title));
    if (all.series.size !== before) all.refresh();
    if (now - drawn < REDRAWN) return;
    drawn = now;
    all.draw(held ?? minute.end);
  }

  function again() {
    minute.empty();
    minute.columns.clear();
    all.clear();
    picked.length = 0;
    held = null;
    begin();
  }

  card.addEventListener("toggle", () => {
    clearInterval(timer);
    minute.empty();
    view?.plotForces(needForces());
    if (card.open) timer = setInterval(sample, PERIOD);
  });
  let known = "";
  const changed = () => { // another scene has other quantities
    const now = JSON.stringify([value("scene")?.name, jointKinds().map(({ name, unit }) => [name, unit])]);
    if (now !== known) { known = now; again(); }
  };
  listen("scene", changed);
  listen("kinds", changed);

  function plotNode(node) {
    if (view.isBall(node.part)) wanted.push("ball", "ball, speed", BALL_FORCE);
    else {
      picked.push(node);
      const title = `${node.name}, node ${node.node}`;
      wanted.push(title, ...view.fieldsAt(node.part, node.node).map(([field]) => `${title}, ${fieldOf(field).label}`));
    }
    card.open = true;
    card.scrollIntoView({ block: "nearest" });
  }
  return { card, plotNode };
}
