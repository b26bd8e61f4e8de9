"use strict";
// Colours of a field with their legend, and boxes for forces: what films and the live page have in common.

const SCALE_SHARE = 0.15; // length that the legend of arrows tells, at most, over the radius of the scene
const SAME = 1e-3; // values that differ by less than that part are one
const shown2 = (v) => String(Number(v.toPrecision(2)));
const shown = (v) => (Number.isFinite(v) ? String(Number(v.toPrecision(3))) : "–");

const LARGE = [["Pa", 1e6, "MPa"], ["Pa", 1e3, "kPa"], ["J/m³", 1e6, "MJ/m³"], ["J/m³", 1e3, "kJ/m³"]];

// A value in words.
function amount(value, unit) {
  if (unit === "m" && Number.isFinite(value)) return length(value);
  const [, factor, name] = LARGE.find(([of, least]) => of === unit && Math.abs(value) >= least) ?? [unit, 1, unit];
  return `${shown(value / factor)} ${name}`.trim();
}

// Numbers of the vertices of the surface of a body.
function surface(body) {
  const { index } = body.geometry;
  if (body.faces !== index) Object.assign(body, { faces: index, surface: [...new Set(index.array)] });
  return body.surface;
}

class Colours {
  // `maps`: tables of colours by name; `changed`: called when the user changed something.
  constructor(view, maps, changed) {
    this.view = view;
    this.maps = Object.fromEntries(Object.entries(maps).map(([name, table]) => [name, spread(table)]));
    this.fields = new Map(); // by name {unit, signed}
    this.chosen = "";
    this.range = null; // fixed: two numbers, or "whole": that of `whole`; null: that of the picture
    this.now = [0, 0];
    this.largest = null; // of the surface: {part, node, value}, of signed values the one farthest from 0
    byId("colour").addEventListener("change", () => { this.choose(byId("colour").value); byId("colour").blur(); changed(); });
    for (const id of ["legend-low", "legend-high"]) byId(id).addEventListener("change", () => { this.fix(); changed(); });
    byId("legend-largest").addEventListener("click", () => { this.view.lookAt(this.largest.part, this.largest.node); changed(); });
    byId("legend-fixed").addEventListener("click", () => { this.range = this.range ? null : this.first ?? [...this.now]; changed(); });
  }

  // Lets the surface be coloured by these fields.
  offer(fields) {
    const select = byId("colour"), names = [...fields.keys()];
    this.fields = fields;
    if ([...select.options].slice(1).map((one) => one.value).join() !== names.join()) {
      while (select.length > 1) select.remove(1);
      for (const name of names) option(select, name, fields.get(name).label ?? name);
    }
    if (!fields.has(this.chosen)) this.choose("");
    select.value = this.chosen;
  }

  // Range at first, and what a fixed one then is: null where nothing but the picture is known.
  get first() { return null; }

  // Lowest and highest value of the chosen field anywhere.
  whole() { return this.now; }

  choose(name) {
    this.chosen = name;
    this.range = this.first;
    this.view.uncover();
    byId("legend").hidden = !name;
    this.find([]);
  }

  // Finds the largest value of the surfaces of bodies as `paint` takes them. Of places that hardly differ, as by
  // symmetry, the one that was found before stays.
  find(parts) {
    const size = this.fields.get(this.chosen)?.signed ? Math.abs : (v) => v, before = this.largest;
    this.largest = null;
    for (const [body, values, part] of parts) {
      for (const node of surface(body)) {
        const value = values[node];
        if (value === value && !(this.largest && size(value) <= size(this.largest.value))) this.largest = { part, node, value };
      }
    }
    const here = before && parts.find(([, , part]) => part === before.part)?.[1][before.node];
    if (size(here) >= (1 - SAME) * size(this.largest?.value)) this.largest = { ...before, value: here };
    byId("legend-largest").hidden = !this.largest;
    if (this.largest) byId("legend-largest").textContent = this.summit;
    this.mark();
  }

  // Marks where the largest value is now.
  mark() { this.view.mark(this.largest && this.view.vertex(this.largest.part, this.largest.node)); }

  // Colours bodies, each [body of the view, a number for each node, its part], and draws the legend.
  paint(parts) {
    let low = Infinity, high = -Infinity, missing = 0, all = 0;
    for (const [body, values] of parts) {
      for (const v of values) { if (v < low) low = v; if (v > high) high = v; }
      for (const node of surface(body)) { all++; if (Number.isNaN(values[node])) missing++; }
    }
    const field = this.fields.get(this.chosen);
    const whole = ([a, b]) => (!(a <= b) ? [0, 0] : field.signed ? [-Math.max(-a, b), Math.max(-a, b)] : [a, b]);
    this.now = whole(this.range === "whole" ? this.whole() : [low, high]);
    const [from, to] = this.limits, map = this.maps[field.signed ? "signed" : "plain"];
    for (const [body, values] of parts) this.view.paint(body, values, from, to, map);
    this.legend(from, to, map);
    this.find(parts);
    this.note(missing ? `grey: ${missing} of ${all} nodes have no value, as in rigid parts` : "");
  }

  get limits() { return Array.isArray(this.range) ? this.range : this.now; }

  get label() { return this.fields.get(this.chosen)?.label ?? this.chosen; }

  get unit() { return this.fields.get(this.chosen)?.unit ?? ""; }

  // From values to what is written, and its unit.
  get scale() { return this.unit === "m" ? [1000, "mm"] : [1, this.unit]; }

  note(text) { if (byId("legend-note").textContent !== text) byId("legend-note").textContent = text; }

  legend(low, high, map) {
    const [factor] = this.scale;
    this.map = map;
    byId("legend-title").textContent = this.title;
    [byId("legend-low"), byId("legend-high")].forEach((input, i) => {
      const end = [low, high][i], noise = 1e-9 * (high - low);
      if (document.activeElement !== input) input.value = shown(Math.abs(end) > noise ? factor * end : 0);
    });
    pressed("legend-fixed", Boolean(this.range));
    const bar = byId("legend-bar"), pen = bar.getContext("2d");
    for (let i = 0; i < 256; i++) {
      pen.fillStyle = `rgb(${map[3 * i]},${map[3 * i + 1]},${map[3 * i + 2]})`;
      pen.fillRect(i, 0, 1, bar.height);
    }
  }

  // Takes the range that was typed.
  fix() {
    const [low, high] = [byId("legend-low"), byId("legend-high")].map((input) => Number(input.value.replace(",", ".")) / this.scale[0]);
    if (Number.isFinite(low) && low < high) this.range = [low, high];
  }

  // A value in words.
  words(value) { return `${this.label} ${amount(value, this.unit)}`; }

  get summit() { return `largest ${amount(this.largest.value, this.unit)}`; }

  get title() { return this.scale[1] ? `${this.label} [${this.scale[1]}]` : this.label; }

  // The legend for a picture: its title, the values at its ends, and the map between them; null: there is none.
  get key() {
    if (!this.chosen || !this.map) return null;
    const [low, high] = this.limits.map((end) => shown(this.scale[0] * end)), { map } = this;
    return { title: this.largest ? `${this.title}, ${this.summit}` : this.title, low, high, map };
  }
}

// Boxes that choose which groups of forces are drawn; at first all are, if `on`.
class ForceBoxes {
  constructor(box, on, view, changed) { Object.assign(this, { box, on, view, changed, labels: new Map(), count: 0 }); }

  // Offers these groups {name, unit, colour, longest}, and no others, on a live page with the `largest` force of each now;
  // `note`: what there is to say beside them.
  offer(groups, note = "") {
    const part = 10 ** Math.floor(Math.log10(SCALE_SHARE * this.view.stage.camera.radius)); // [m]
    for (const [name, label] of this.labels) {
      if (groups.some((group) => group.name === name)) continue;
      label.remove();
      this.labels.delete(name);
    }
    for (const group of groups) {
      if (!this.labels.has(group.name)) this.add(group);
      const scale = this.view.scaleOf(group, groups), drawn = scale ? `: ${length(part)} = ${shown2(part / scale)} ${group.unit}` : "";
      const size = group.largest === undefined ? `up to ${shown2(group.longest)}` : `now ${shown2(group.largest)}`;
      this.labels.get(group.name).lastChild.data = ` ${group.name}${drawn}, ${size} ${group.unit}`;
    }
    for (const group of groups) this.labels.get(group.name).hidden = !group.longest; // it has not acted yet
    this.box.dataset.note = note;
    this.box.hidden = !groups.length && !note;
  }

  add({ name, colour }) {
    const label = document.createElement("label"), tick = document.createElement("input"), mark = document.createElement("b");
    Object.assign(tick, { type: "checkbox", id: `arrow-${this.count++}`, checked: this.on });
    tick.addEventListener("change", () => { tick.blur(); this.changed(); });
    mark.textContent = "➜";
    mark.style.color = `rgb(${colour.join()})`;
    label.append(tick, mark, document.createTextNode(""));
    this.box.append(label);
    this.labels.set(name, label);
  }

  // What the boxes say of the groups that are drawn, each {text, colour}, for a picture.
  get lines() {
    const drawn = [...this.labels.values()].filter((label) => !this.box.hidden && !label.hidden && label.firstChild.checked);
    return drawn.map((label) => ({ text: label.lastChild.data.trim(), colour: label.querySelector("b").style.color }));
  }

  has(name) { return Boolean(this.labels.get(name)?.firstChild.checked); }
}
