// What a click on a body tells: the node, where it is, how far it has moved, and how a scene names it.

import { value } from "./channel.js";

const PERIOD = 200; // [ms]
const SMALL = 0.3; // radius of the set about a node over its shortest edge

const short = (place) => place.map((v) => Number(v.toPrecision(5))).join(", ");

// Shows it over the picture of `view`; `plotNode`: plots one.
export function tellPicked(view, plotNode) {
  let hit = null, timer = 0;
  const told = byId("picked"), plot = byId("plot-picked"), copy = byId("set-picked"), text = byId("set");

  function tell() {
    const place = hit && view.vertex(hit.part, hit.node), { radius } = view.stage.camera;
    if (!place) { show(null); return; }
    if (view.isBall(hit.part)) {
      const { place: middle, speed, force } = view.ball(), mm = (1e3 * speed).toPrecision(2);
      const pressed = Number.isFinite(force) ? `; contact force ${Number(force.toPrecision(2))} N` : "; contact force: with Forces or a plot of it";
      told.textContent = `ball at ${placed(middle, radius)}${Number.isFinite(speed) ? `; speed ${Number(mm)} mm/s` : ""}${pressed}`;
      copy.hidden = true;
      return;
    }
    const rest = view.rest(hit.part, hit.node), moved = rest ? `; moved ${length(Math.hypot(...place.map((v, a) => v - rest[a])))}` : "";
    const fields = view.fieldsAt(hit.part, hit.node).map(([name, number]) => {
      const { label = name, unit = "" } = value("fields")?.find((field) => field.name === name) ?? {};
      return `; ${label} ${Number.isFinite(number) ? amount(number, unit) : "has no value"}`;
    });
    told.textContent = `${hit.body}, node ${hit.node} at ${placed(place, radius)}${moved}${fields.join("")}`;
    copy.hidden = !rest;
  }

  function show(found) {
    hit = found;
    clearInterval(timer);
    plot.hidden = copy.hidden = told.hidden = !hit;
    text.hidden = true;
    if (!hit) return;
    tell();
    timer = setInterval(tell, PERIOD);
  }

  onPick(view, show);
  plot.addEventListener("click", () => plotNode({ name: hit.body, part: hit.part, node: hit.node }));
  copy.addEventListener("click", () => {
    if (!text.hidden) { text.hidden = true; return; }
    const rest = view.rest(hit.part, hit.node), edge = view.edge(hit.part, hit.node);
    text.textContent = `[[set]]\nname = "node_${hit.node}"\ncentre = [${short(rest)}]\nradius = ${Number((SMALL * edge).toPrecision(2))}`;
    text.hidden = false;
    getSelection().selectAllChildren(text);
    navigator.clipboard?.writeText(text.textContent).catch(() => {}); // it is selected, too
  });
}
