// Hands on the bodies: pull them by the mouse, place loads, run slower or faster. Only in the simulation.

import { listen, send, value } from "./channel.js";
import { button, element, place, section, setText } from "./dom.js";

const REPEAT = 200; // a hand that says nothing for a second lets go [ms]
const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10];
const NOT_PULLED = "Not pulled: this is neither a soft nor a free body. Drag one of those.";
const ME = crypto.getRandomValues(new Uint32Array(1))[0] >>> 3; // whose hand it is, among the pages

// `view`: the 3-D scene, null where the browser cannot draw. Returns a card for the panel.
export function hands(view) {
  const redraw = () => view.changed();
  const stiffness = element("input", { type: "number", min: 0, step: "any", "aria-label": "stiffness of the pull (N/m)" });
  const told = element("p", { class: "small", id: "hands-told" });
  const speed = element("select", { id: "speed", "aria-label": "speed" });
  for (const factor of SPEEDS) place(speed, [element("option", { value: factor }, `${factor} ×`)]);
  speed.value = 1;
  speed.addEventListener("change", () => { send({ speed: Number(speed.value) }); speed.blur(); });
  stiffness.addEventListener("change", () => { stiffness.dataset.own = "1"; });
  const on = view && puller(view, redraw, () => Number(stiffness.value) || null);
  if (on) addTools(byId("page-tools"), { pull: on.toggle }, { pull: "g" });
  const force = ["x", "y", "z"].map((axis) => element("input", { type: "number", step: "any", value: 0, "aria-label": `load along ${axis} (N)` }));
  const at = element("p", { class: "small", id: "load-at" }, "Click on the body to choose where.");
  let chosen = null;
  on?.picked((found) => {
    chosen = found;
    setText(at, `At ${found.body}, node ${found.node}.`);
    load.disabled = false;
    load.title = "";
  });
  const load = button("Place load", () => {
    const vector = force.map((one) => Number(one.value) || 0);
    send({ load: { vertex: chosen.vertex, force: vector } });
    on.load(chosen, vector);
    const zero = vector.some(Boolean) ? "" : " A load of 0 N is none: type a force.";
    setText(at, `At ${chosen.body}, node ${chosen.node}.${zero}`);
  }, "Click on the body first");
  const unload = button("Remove loads", () => send({ sim: "unload" }));
  load.id = "load";
  load.disabled = unload.disabled = true;
  listen("figures", (figures) => {
    if (document.activeElement !== stiffness && figures?.stiffness && !stiffness.dataset.own) stiffness.value = figures.stiffness;
    if (document.activeElement !== speed && figures?.speed) speed.value = figures.speed;
    setText(told, figures?.hands ? `Acts now: ${figures.hands}` : "");
    unload.disabled = !figures?.hands?.includes("load");
    unload.title = unload.disabled ? "No load acts" : "";
    on?.tell(figures?.hands ?? "");
    if (unload.disabled) on?.load(null);
  });
  return section("hands", "Pull, load, speed", [
    element("p", { class: "small" }, "Press Pull over the picture, then drag a body."),
    place(element("div", { class: "row" }), [place(element("label", {}, "spring of the pull "), [stiffness, " N/m"])]),
    told,
    place(element("div", { class: "row" }), [element("label", {}, "load x, y, z [N]"), ...force, load, unload]),
    at,
    place(element("div", { class: "row" }), [place(element("label", {}, "speed "), [speed])]),
    element("p", { class: "small" }, "Only in the simulation: the robot is not told. A recording holds it, so a replay is the same."),
  ], false);
}

// Lets a mouse or a finger pull the body while that is switched on.
function puller(view, redraw, stiffness) {
  const { canvas } = view, heard = [];
  let pulls = false, held = null, timer = 0, placed = 0, barred = false, acts = ""; // `held`: what was picked, where it was and is to go

  const tell = (hands = acts) => {
    acts = hands;
    setText(byId("hand-told"), barred ? NOT_PULLED : acts);
  };
  // Keeps the camera still while a drag that can pull nothing lasts, and says so.
  const bar = (on) => {
    barred = on;
    view.controls.enabled = !on;
    tell();
  };
  const say = () => send({ pull: { who: ME, vertex: held.vertex, from: held.start, to: held.to, stiffness: stiffness() } });
  const letGo = () => {
    if (!held) return;
    held = null;
    clearInterval(timer);
    view.controls.enabled = true;
    view.point("hand", [], [], [0, 0, 0], 1);
    send({ let_go: ME });
    redraw();
  };
  const loads = new Map(); // that this page placed: vertex to {part, node, vector}
  const draw = () => {
    const from = held && view.vertex(held.part, held.node);
    if (from) view.point("hand", from, held.to.map((v, a) => v - from[a]), [30, 30, 30], 1);
    if (!loads.size) return;
    const there = [...loads.values()].map(({ part, node, vector }) => [view.vertex(part, node), vector]).filter(([at]) => at);
    const longest = Math.max(...there.map(([, vector]) => Math.hypot(...vector)));
    view.point("loads", there.flatMap(([at]) => at), there.flatMap(([, vector]) => vector), [30, 30, 30], view.arrowScale(longest));
  };
  const load = (at, vector) => {
    if (!at) {
      if (!loads.size || performance.now() - placed < 2000) return; // one that was just placed is told a little later
      loads.clear();
      view.point("loads", [], [], [0, 0, 0], 1);
      redraw();
      return;
    }
    placed = performance.now();
    if (Math.hypot(...vector) > 0) loads.set(at.vertex, { ...at, vector }); else loads.delete(at.vertex);
    redraw();
  };

  // Where the pointer is in the plane through the held point that faces the eye.
  function onPlane({ clientX, clientY }) {
    const T = THREE, box = canvas.getBoundingClientRect(), caster = new T.Raycaster(), normal = new T.Vector3();
    caster.setFromCamera(new T.Vector2(2 * (clientX - box.left) / box.width - 1, 1 - 2 * (clientY - box.top) / box.height), view.camera);
    view.camera.getWorldDirection(normal);
    const start = new T.Vector3(...held.start.map((v, a) => v - view.origin[a]));
    const { origin, direction } = caster.ray, far = start.sub(origin).dot(normal) / direction.dot(normal);
    return far > 0 ? origin.clone().addScaledVector(direction, far).toArray().map((v, a) => v + view.origin[a]) : null;
  }

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !event.isPrimary) return;
    const found = view.pick(event), works = pulls && (value("replay")?.age ?? null) === null;
    if (barred) bar(false);
    if ((found?.vertex ?? null) === null) { // the ball of a maze has none
      if (works && view.controls.enableRotate && view.pick(event, view.solids())) bar(true); // no handle is there
      return;
    }
    for (const choose of heard) choose(found);
    if (!works) return;
    event.stopImmediatePropagation();
    canvas.setPointerCapture(event.pointerId);
    view.controls.enabled = false;
    held = { ...found, start: found.point, to: found.point };
    say();
    timer = setInterval(say, REPEAT);
  }, true);
  canvas.addEventListener("pointermove", (event) => {
    const to = held && onPlane(event);
    if (!to) return;
    held.to = to;
    say();
    redraw();
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(name, letGo);
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { if (barred) view.controls.enabled = true; });
  addEventListener("blur", letGo);
  listen("connected", (there) => { if (!there) letGo(); });
  view.before = draw; // the arrow goes along with the body

  const toggle = () => {
    pulls = !pulls;
    letGo();
    bar(false);
    canvas.classList.toggle("pulls", pulls);
    pressed("pull", pulls);
  };
  addEventListener("keydown", (event) => {
    if (event.key === "g" && !event.ctrlKey && !event.altKey && !event.metaKey && !/^(INPUT|SELECT)$/.test(event.target.tagName)) toggle();
  });
  return { toggle, load, tell, picked: (choose) => heard.push(choose) };
}
