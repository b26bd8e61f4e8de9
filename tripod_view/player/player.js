"use strict";
// The page that plays a film.

const PARTS = /^(servo|arm|goal)\b/; // pieces that no camera follows

// By the fields of the film.
class FilmColours extends Colours {
  constructor(film, view, changed) {
    super(view, film.stage.maps, changed);
    this.film = film;
    const names = new Map();
    film.stage.bodies.forEach((body, b) => body.fields.forEach((field, f) => {
      if (!names.has(field.name)) names.set(field.name, { unit: field.unit, signed: field.signed, of: [] });
      names.get(field.name).of.push([b, f]);
    }));
    const all = film.stage.bodies.map((_, b) => [b, -1]).filter(([b]) => film.stage.bodies[b].nodes);
    const moved = names.has("displacement") ? [] : [["moved since the first picture", { unit: "m", signed: false, of: all }]];
    this.values = film.stage.bodies.map((body) => new Float32Array(body.nodes));
    this.offer(new Map([...moved, ...names]));
  }

  get first() { return "whole"; }

  whole() {
    const ends = this.fields.get(this.chosen).of.map(([b, f]) => this.film.limits(b, f));
    return [Math.min(...ends.map(([low]) => low)), Math.max(...ends.map(([, high]) => high))];
  }

  // Colours the picture at hand.
  update(moment) {
    const field = this.fields.get(this.chosen);
    if (!field) return;
    for (const [b, f] of field.of) {
      if (f < 0) this.film.displacement(b, moment, this.values[b]); else this.film.values(b, f, moment, this.values[b]);
    }
    this.paint(field.of.map(([b]) => [this.view.bodies[b], this.values[b], b]));
  }

  // The value at a node of a body, in words; empty where there is none.
  at(b, node) {
    const there = this.fields.get(this.chosen)?.of.some(([body]) => body === b);
    return there ? this.words(this.values[b][node]) : "";
  }
}

async function main() {
  const stage = JSON.parse(byId("film").textContent), first = JSON.parse(byId("reel").textContent);
  byId("description").textContent = stage.description;
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old for this page: it cannot unpack it");
  const library = document.createElement("script");
  library.textContent = await unpackText(byId("library").textContent);
  document.head.append(library);
  const film = new Film(stage), canvas = byId("picture"), read = await unpack(stage.data);
  let asked = 0, time = 0, playing = false, live = !first, showLines = false, showPath = false, waiting = false, followed = stage.camera.follow ? "bodies" : "";
  const redraw = () => { if (!asked) asked = requestAnimationFrame(paint); };
  let view;
  try {
    view = new View(canvas, stage, read, redraw);
  } catch (error) {
    console.info(error.message);
    throw new Error("this browser has no WebGL 2, so the picture stays empty; the curves still play. Switch on hardware acceleration in the settings of the browser, or open this page in another one (Firefox, Chrome)");
  }
  const colours = new FilmColours(film, view, redraw), picked = [];
  const seek = (t) => { time = clamp(t, film.start, film.end); redraw(); };
  const jump = (t) => { play(false); seek(t); };
  const plots = new Plots(byId("panels"), film, jump);
  stage.curves.forEach(({ title, unit, names, limits }, c) =>
    plots.show(title, names.map((name, n) => plots.offer(title, name, unit, (i) => film.curves[c][i][n])), limits));
  const happened = document.createElement("ul"), source = document.createElement("p");
  source.className = "source"; source.textContent = stage.source;
  byId("panels").append(happened, source);

  // ---- controls

  if (stage.colouring) {
    byId("colour").value = stage.colouring.name;
    colours.choose(stage.colouring.name);
    colours.range = stage.colouring.limits ?? colours.first;
  }
  option(byId("follow"), "", "stand still");
  option(byId("follow"), "bodies", "follow bodies");
  const movers = new Map();
  stage.pieces.forEach((piece, p) => { if (piece.moves && !movers.has(piece.name) && !PARTS.test(piece.name)) movers.set(piece.name, p); });
  for (const [name, p] of movers) option(byId("follow"), String(p), `follow ${name}`);
  const main = ["ball", "effector", "maze", ...movers.keys()].find((name) => movers.has(name)); // whose path is drawn
  byId("follow").value = followed;
  byId("follow").addEventListener("change", (e) => { followed = e.target.value; redraw(); });
  const boxes = new ForceBoxes(byId("arrows"), false, view, redraw);
  const then = (act) => () => { act(); redraw(); };
  const all = (actions) => Object.fromEntries(Object.entries(actions).map(([name, act]) => [name, then(act)]));
  const cameras = all(cameraActions(view)), more = all({
    lines: () => { showLines = !showLines; view.showLines(showLines); pressed("lines", showLines); },
    path: () => { showPath = !showPath; pressed("path", showPath); },
    shot: async () => save(`${stage.title}.png`, await view.screenshot(BACKGROUND, [`${stage.title}, ${time.toFixed(2)} s`], colours.key, boxes.lines)),
    panel: () => { byId("panels").hidden = !byId("panels").hidden; pressed("panel", !byId("panels").hidden); },
    help: () => toggleSheet(true),
  });
  const keys = { home: "r", fit: "f", top: "t", front: "w", side: "s", below: "b", lines: "l", path: "c", shot: "p", panel: "h", help: "?" };
  addTools(byId("camera-tools"), cameras, keys);
  addTools(byId("page-tools"), more, keys);
  byId("path").hidden = !main;
  byId("play").addEventListener("click", () => play(!playing));

  function tell() {
    happened.replaceChildren(...film.events.map(([t, text]) => {
      const item = document.createElement("li"), button = document.createElement("button");
      button.textContent = `${t.toFixed(2)} s  ${text}`;
      button.addEventListener("click", () => jump(t));
      item.append(button);
      return item;
    }));
  }

  // ---- pictures

  function paint(now) {
    asked = 0;
    if (playing) {
      time += Math.min((now - (paint.last ?? now)) / 1000, 0.25) * Number(byId("speed").value);
      if (time >= film.end) { time = film.end; if (live) waiting = true; else play(false); }
      paint.last = now;
    }
    if (film.length) picture();
    if (playing) redraw();
  }

  // Where the camera goes along with what it follows.
  function origin(moment) {
    const centre = stage.camera.centre;
    if (!followed) return centre;
    if (followed === "bodies") return film.middle(moment);
    const pose = film.pose(Number(followed), moment);
    return pose ? pose.slice(0, 3) : view.origin;
  }

  function picture() {
    const moment = film.at(time);
    view.follows = Boolean(followed);
    view.origin = origin(moment);
    stage.bodies.forEach((_, b) => { film.nodes(b, moment, view.origin, view.nodes(b)); view.update(b); });
    stage.pieces.forEach((piece, p) => view.place(p, piece.moves ? film.pose(p, moment) : [0, 0, 0, 0, 0, 0, 1]));
    colours.update(moment);
    boxes.offer(stage.arrows);
    stage.arrows.forEach((arrow, a) => {
      const { points, vectors } = film.arrows[a][moment[0]], on = boxes.has(arrow.name), none = new Float32Array(0);
      view.point(arrow.name, on ? points : none, on ? vectors : none, arrow.colour, view.scaleOf(arrow, stage.arrows));
    });
    view.trail(showPath ? film.path(movers.get(Number(followed) ? stage.pieces[followed].name : main), moment) : []);
    view.render();
    plots.draw(time);
    const bar = byId("time");
    bar.min = film.start; bar.max = film.end; bar.value = time;
    byId("clock").textContent = `${time.toFixed(2)} of ${film.end.toFixed(2)} s`;
    byId("scale").textContent = `one square of the floor: ${length(view.cell)}`;
    const past = film.events.filter(([t]) => t <= time + 1e-9).map(([, text]) => text);
    byId("message").textContent = past.length ? past[past.length - 1] : "";
    tellPicked(moment);
  }

  function play(on) {
    playing = on && film.length > 1;
    if (playing && time >= film.end && !live) time = film.start;
    paint.last = undefined;
    byId("play").textContent = playing ? "❚❚" : "▶";
    redraw();
  }

  // ---- a node that is clicked

  // Size of the sum of the contact forces on a body in picture i [N]; NaN where they were not recorded.
  function contactForce(name, i) {
    const of = stage.arrows.flatMap((arrow, a) => (arrow.name.includes(` on ${name} by `) ? [film.arrows[a][i].vectors] : []));
    const sum = [0, 0, 0];
    for (const vectors of of) vectors.forEach((v, k) => { sum[k % 3] += v; });
    return of.length ? Math.hypot(...sum) : NaN;
  }

  // Mean speed of piece p from the picture before number i to the one behind it [m/s].
  function speed(p, i) {
    const [a, b] = [Math.max(i - 1, 0), Math.min(i + 1, film.length - 1)], [one, two] = [film.poses[p][a], film.poses[p][b]];
    return Math.hypot(...[0, 1, 2].map((k) => two[k] - one[k])) / (film.times[b] - film.times[a]);
  }

  const contactWords = (name, i) => {
    const force = contactForce(name, i);
    return Number.isFinite(force) ? `; contact force ${shown2(force)} N` : "";
  };

  function tellPicked(moment) {
    if (!picked.length) return;
    const p = picked[0] - stage.bodies.length;
    if (p >= 0) {
      const pose = film.pose(p, moment), { name } = stage.pieces[p], at = pose && placed(pose, stage.camera.radius);
      byId("picked").textContent = pose ? `${name} at ${at}; speed ${shown2(1e3 * speed(p, moment[0]))} mm/s${contactWords(name, moment[0])}` : `${name}: not there`;
      return;
    }
    const [b, node] = picked, place = new Float64Array(3 * stage.bodies[b].nodes);
    film.nodes(b, moment, [0, 0, 0], place);
    const at = placed(place.slice(3 * node), stage.camera.radius), value = colours.at(b, node);
    byId("picked").textContent = `${stage.bodies[b].name}, node ${node} at ${at}${value ? `; ${value}` : ""}${contactWords(stage.bodies[b].name, moment[0])}`;
  }

  onPick(view, (hit) => {
    picked.splice(0, picked.length, ...(hit ? [hit.part, hit.node] : []));
    byId("picked").textContent = "";
    byId("plot-picked").hidden = byId("picked").hidden = !hit;
    redraw();
  });
  byId("plot-picked").addEventListener("click", () => { plotNode(...picked); redraw(); });

  function plotContact(name) {
    if (!stage.arrows.some((arrow) => arrow.name.includes(` on ${name} by `))) return;
    const title = `${name}, contact force`;
    plots.show(title, [plots.offer(title, "contact force", "N", (i) => contactForce(name, i))]);
  }

  function plotPiece(p) {
    const { name } = stage.pieces[p], title = `${name}, speed`;
    plots.show(name, ["x", "y", "z"].map((axis, a) => plots.offer(name, axis, "mm", (i) => 1000 * film.poses[p][i][a])));
    plots.show(title, [plots.offer(title, "speed", "mm/s", (i) => 1000 * speed(p, i))]);
    plotContact(name);
  }

  function plotNode(b, node) {
    if (b >= stage.bodies.length) { plotPiece(b - stage.bodies.length); return; }
    const title = `${stage.bodies[b].name}, node ${node}`;
    plots.show(title, ["x", "y", "z"].map((axis, a) => plots.offer(title, axis, "mm", (i) => {
      const { low, step, whole } = film.bodies[b][i];
      return 1000 * (low[a] + step[a] * whole[3 * node + a]);
    })));
    plotContact(stage.bodies[b].name);
  }

  splitAt(byId("split"), (width) => { byId("panels").style.width = `${width}px`; redraw(); });

  // ---- keys, time

  byId("time").addEventListener("input", (e) => jump(Number(e.target.value)));
  window.addEventListener("resize", redraw);
  window.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.altKey || e.metaKey || ["INPUT", "SELECT"].includes(e.target.tagName) && e.key !== " ") return;
    const [i] = film.at(time);
    const name = Object.keys(keys).find((one) => keys[one] === e.key);
    const act = { ...cameras, ...more }[name] ?? { " ": () => play(!playing), ArrowRight: () => jump(film.times[Math.min(i + 1, film.length - 1)]),
      ArrowLeft: () => jump(film.times[Math.max(i - 1, 0)]), Home: () => seek(film.start), End: () => seek(film.end) }[e.key];
    if (act) { e.preventDefault(); if (e.target.blur) e.target.blur(); act(); redraw(); }
  });

  const wanted = /^#t=([\d.]+)$/.exec(location.hash);
  async function take(reel) {
    const before = film.length;
    await film.append(reel);
    plots.refresh();
    tell();
    if (!before && film.length) { if (wanted) seek(Number(wanted[1])); else { time = film.start; play(true); } }
    waiting = false;
    redraw();
  }
  if (first) await take(first);
  while (live) {
    const answer = await fetch(`${location.pathname.replace(/\/$/, "")}/reel?from=${film.length}`);
    if (!answer.ok) throw new Error(`the run cannot be read any more: ${answer.status}`);
    const { reel, camera, done } = await answer.json();
    if (camera) view.widen(camera);
    if (reel) await take(reel);
    live = !done;
    if (live) await new Promise((wake) => setTimeout(wake, 200));
  }
  redraw();
}

main().catch((error) => { byId("message").textContent = error.message; });
