// The three promises: what accuracy costs, what effects cost, how stable the run is.

import { listen, send, value } from "./channel.js";
import { button, element, percent, place, section, setText } from "./dom.js";
import { front } from "./front.js";

export function cards() {
  return place(element("div"), [accuracy(), effects(), stability()]);
}

function accuracy() {
  const here = element("p", { id: "here" });
  const errors = element("p", { id: "errors", hidden: "" });
  const picture = element("div");
  const table = element("table", { id: "offers" });
  const about = element("p", { class: "small" });
  const show = () => {
    const figures = value("accuracy");
    const run = value("run");
    if (!figures) return;
    const seconds = run && run.dt > 0 && !figures.solves ? run.step / run.dt : null;
    const cost = seconds ? `; its steps could run at ${Number((1 / seconds).toPrecision(2))} x real time` : "";
    const known = figures.measured !== null && figures.measured !== undefined;
    const error = known ? `about ${percent(figures.measured)} (measured in the accuracy study)` : figures.line;
    setText(here, `You are here: error ${error}${cost}`);
    here.title = bound(figures);
    picture.replaceChildren(...(figures.front?.length ? [front(figures, known ? seconds ?? figures.here_seconds : null)] : []));
    setText(about, figures.study ? `Errors as the accuracy study ${figures.study} measured them, of: ${figures.quantity}. Times of ${figures.scaled ? "this" : "the study's"} machine, in the study's motion.` : "");
  };
  listen("accuracy", (figures) => {
    show();
    const rows = (figures.offers ?? []).map((offer) => offered(offer, figures));
    table.replaceChildren(...(rows.length ? [head(), ...rows] : []));
  });
  listen("figures", (figures) => {
    errors.hidden = !figures?.errors;
    setText(errors, figures?.errors ? `Effector now: ${figures.errors} (estimated)` : "");
  });
  let last = 0;
  listen("run", () => {
    if (performance.now() - last < 1000) return;
    last = performance.now();
    show();
  });
  return section("accuracy", "Accuracy and time", [here, errors, picture, table, about]);
}

function head() {
  return row(["", "error about", "x real time"], "th");
}

// What is promised for other motions, shown on request.
function bound(figures) {
  return figures.bound === null || figures.bound === undefined ? "" : `expected below ${percent(figures.bound)} in other motions`;
}

function offered(offer, figures) {
  const name = offer.wish.endsWith("%") ? `below ${offer.wish.replace("%", " %")}` : offer.wish.replace("-", " ");
  const choose = button(name, () => send({ accuracy: offer.wish }), offer.why_not || `Start again with ${offer.settings}${offer.bound === null ? "" : `; error ${bound(offer)}`}`);
  choose.disabled = Boolean(offer.why_not);
  if (offer.why_not) {
    const made = row([choose, offer.why_not.split(";")[0]]);
    made.cells[1].colSpan = 2;
    return made;
  }
  const here = offer.settings && offer.settings === figures.settings;
  const times = offer.seconds && !figures.solves ? Number((1 / offer.seconds).toPrecision(2)) : "not known";
  const error = offer.measured === null ? "not known" : percent(offer.measured);
  return row([choose, here ? `${error} (as now)` : error, String(times)]);
}

function row(cells, tag = "td") {
  const made = element("tr");
  for (const cell of cells) {
    const box = element(tag);
    box.append(cell);
    made.append(box);
  }
  return made;
}

function effects() {
  const on = element("div", { class: "chips", id: "on" });
  const off = element("div", { class: "chips", id: "off" });
  const reasons = element("div", { class: "small", id: "barred" });
  const without = place(element("details", { class: "inner" }), [element("summary", {}, "not possible in this scene"), reasons]);
  const changes = element("p", { class: "small" });
  const shipped = button("As shipped", () => send({ sim: "as_shipped" }), "Start again without what was changed here");
  listen("effects", (list) => {
    on.replaceChildren(...list.filter((effect) => effect.on).map(chip));
    off.replaceChildren(...list.filter((effect) => !effect.on && !effect.why_not).map(chip));
    const barred = list.filter((effect) => !effect.on && effect.why_not);
    reasons.replaceChildren(...barred.map(reason));
    without.hidden = !barred.length;
  });
  listen("scene", (scene) => {
    shipped.hidden = !scene.changes.length;
    setText(changes, scene.changes.length ? `Changed: ${scene.changes.join("; ")}` : "");
  });
  const about = element("p", { class: "small" }, "A click starts the scene again with it, or without. tripod explain measures what each costs.");
  return section("effects", "Effects", [element("h3", {}, "in this scene"), on, element("h3", {}, "absent"), off, without, changes, shipped, about], false);
}

// Most reasons begin with the name of the effect.
function reason({ name, why_not: text }) {
  const rest = text.startsWith(`${name} `) ? text.slice(name.length) : `: ${text}`;
  return place(element("p"), [element("b", {}, name), rest]);
}

function chip(effect) {
  const made = button("", () => send({ effect: effect.name, on: !effect.on }), effect.meaning);
  made.className = effect.on ? "chip on" : "chip";
  return place(made, [element("b", {}, effect.name)]);
}

function stability() {
  const table = element("table", { id: "stable" });
  listen("figures", (figures) => {
    const rows = figures?.lines ?? [["figures", "the simulator tells none"]];
    rows.forEach(([name, text], i) => {
      const old = table.rows[i] ?? table.insertRow();
      if (!old.cells.length) place(old, [element("th"), element("td")]);
      setText(old.cells[0], name);
      setText(old.cells[1], text);
    });
    while (table.rows.length > rows.length) table.deleteRow(-1);
    table.classList.toggle("bad", Boolean(figures?.unstable || figures?.energy?.grew));
  });
  return section("stability", "Stability", [table], false);
}
