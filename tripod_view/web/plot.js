"use strict";
// Plots of numbers over time. A record has the `times` of its entries, their number `length`, `start` and `end`, and
// `at(time)`, of which the first item is the entry at that time. A series has a name, a unit and a value `at` each entry.

const COLOURS = ["#d64045", "#1f77b4", "#945abe", "#2a9d5c", "#e08a00", "#555"];
const MARGIN = { left: 46, right: 6, top: 6, bottom: 18 }; // about the area of the curves

// A step of 1, 2 or 5 times a power of ten that divides `span` into about `count` parts.
function tick(span, count) {
  const raw = span / count, power = 10 ** Math.floor(Math.log10(raw));
  return power * ([1, 2, 5].find((m) => m * power >= raw) ?? 10);
}

// A number with the digits that tell ticks `step` apart.
const ticked = (v, step) => step < 1e-5 || step >= 1e7 ? (Math.abs(v) < step / 2 ? "0" : v.toExponential(1)) : v.toFixed(clamp(Math.ceil(-Math.log10(step) - 1e-9), 0, 9)).replace(/^-(?=[0.]+$)/, "");

class Plot {
  constructor(plots, title, unit, series, limits) {
    Object.assign(this, { plots, record: plots.record, title, unit, series, limits });
    this.box = document.createElement("section");
    this.box.className = "plot";
    const head = document.createElement("h2");
    head.textContent = unit ? `${title} [${unit}]` : title;
    const tools = document.createElement("span");
    const tool = (text, what, act) => {
      const button = document.createElement("button");
      button.textContent = text;
      button.title = what;
      button.setAttribute("aria-label", `${what}: ${title}`);
      button.addEventListener("click", act);
      tools.append(button);
    };
    tool("CSV", "save the numbers", () => save(`${title}.csv`, new Blob([this.csv()], { type: "text/csv" })));
    tool("PNG", "save the plot", () => this.canvas.toBlob((blob) => save(`${title}.png`, blob)));
    tool("×", "remove the plot", () => plots.remove(this));
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("aria-label", title);
    head.append(tools);
    this.box.append(head, this.legend, this.canvas);
    const pick = (e) => {
      const box = this.canvas.getBoundingClientRect(), wide = box.width - MARGIN.left - MARGIN.right;
      plots.jump(this.record.start + clamp((e.clientX - box.left - MARGIN.left) / wide, 0, 1) * (this.record.end - this.record.start));
    };
    this.canvas.addEventListener("pointerdown", (e) => { this.canvas.setPointerCapture(e.pointerId); pick(e); });
    this.canvas.addEventListener("pointermove", (e) => { if (e.buttons) pick(e); });
  }

  csv() {
    const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    const columns = this.record.clock ? [this.record.clock, ...this.series] : this.series;
    const rows = [["time [s]", ...columns.map((s) => `${s.name} [${s.unit}]`)].map(quoted).join(",")];
    this.record.times.forEach((t, i) => rows.push([Number(t.toFixed(6)), ...columns.map((s) => (Number.isFinite(s.at(i)) ? s.at(i) : ""))].join(",")));
    return `${rows.join("\n")}\n`;
  }

  range() {
    let low = Infinity, high = -Infinity;
    for (const s of this.series) for (let i = 0; i < this.record.length; i++) {
      const v = s.at(i);
      if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    }
    if (low > high) [low, high] = [0, 1];
    const near = this.limits.filter((v) => v > low - (high - low) && v < high + (high - low));
    low = Math.min(low, ...near); high = Math.max(high, ...near);
    const pad = Math.max(0.06 * (high - low), 0.02 * Math.max(Math.abs(low), Math.abs(high))) || 1;
    return { low: low - pad, high: high + pad, near };
  }

  draw(time) {
    const { record, canvas } = this, ratio = clamp(window.devicePixelRatio || 1, 1, 2);
    const width = canvas.clientWidth, height = canvas.clientHeight, pen = canvas.getContext("2d");
    if (!width || !record.length) return;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const { low, high, near } = this.range(), span = record.end - record.start || 1;
    const w = width - MARGIN.left - MARGIN.right, h = height - MARGIN.top - MARGIN.bottom;
    const x = (t) => MARGIN.left + (t - record.start) / span * w, y = (v) => MARGIN.top + h - (v - low) / (high - low) * h;
    const line = (colour, dash, ...points) => {
      pen.strokeStyle = colour; pen.setLineDash(dash); pen.beginPath();
      points.forEach(([a, b], i) => (i ? pen.lineTo(a, b) : pen.moveTo(a, b)));
      pen.stroke();
    };
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = "#f7f9fb";
    pen.fillRect(MARGIN.left, MARGIN.top, w, h);
    pen.lineWidth = 1; pen.font = "11px system-ui, sans-serif";
    const across = tick(span, w / 70), up = tick(high - low, h / 30);
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (let t = Math.ceil(record.start / across - 1e-9) * across; t <= record.end + 1e-9 * span; t += across) {
      line("#dfe5ea", [], [x(t), MARGIN.top], [x(t), MARGIN.top + h]);
      pen.fillStyle = "#667";
      pen.fillText(`${ticked(t, across)}${t + across > record.end + 1e-9 * span ? " s" : ""}`, Math.min(x(t), width - 14), MARGIN.top + h + 4);
    }
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (let v = Math.ceil(low / up) * up; v <= high; v += up) {
      line(Math.abs(v) < 1e-9 * up ? "#b9c3cc" : "#e6ebef", [], [MARGIN.left, y(v)], [MARGIN.left + w, y(v)]);
      pen.fillStyle = "#667";
      pen.fillText(ticked(v, up), MARGIN.left - 4, y(v));
    }
    for (const v of near) line("#c33", [4, 3], [MARGIN.left, y(v)], [MARGIN.left + w, y(v)]);
    const stride = Math.max(1, Math.floor(record.length / (2 * w)));
    this.series.forEach((s, c) => {
      pen.strokeStyle = COLOURS[c % COLOURS.length]; pen.setLineDash([]); pen.lineWidth = 1.4; pen.beginPath();
      let drawing = false;
      for (let i = 0; i < record.length; i += stride) {
        const v = s.at(i);
        if (!Number.isFinite(v)) { drawing = false; continue; }
        if (drawing) pen.lineTo(x(record.times[i]), y(v)); else pen.moveTo(x(record.times[i]), y(v));
        drawing = true;
      }
      pen.stroke();
    });
    pen.lineWidth = 1;
    line("#222", [], [x(time), MARGIN.top], [x(time), MARGIN.top + h]);
    const [i] = record.at(time);
    this.legend.replaceChildren(...this.series.flatMap((s, c) => {
      const name = document.createElement("b"), v = s.at(i);
      name.style.color = COLOURS[c % COLOURS.length];
      name.textContent = `${s.name} `;
      const exact = Math.abs(v) > 1e-9 * (high - low) ? v : 0; // rounding is none
      return [name, `${Number.isFinite(v) ? String(Number(exact.toPrecision(4))) : "–"}  `];
    }));
  }
}

// The name of a series and what it is of, each once.
const fullName = ({ title, name }) => (title.endsWith(name) ? title : `${title}: ${name}`);

class Plots {
  // Below `parent`, of `record`; `jump`: called with a time that is chosen in a plot.
  constructor(parent, record, jump) {
    Object.assign(this, { record, jump, plots: [], series: new Map() });
    this.box = document.createElement("div");
    this.more = document.createElement("select");
    this.more.id = "more";
    this.more.setAttribute("aria-label", "add a plot");
    parent.append(this.box, this.more);
    this.more.addEventListener("change", () => {
      const { value } = this.more, bar = value.indexOf("|"), where = value.slice(0, bar), key = value.slice(bar + 1);
      const s = this.series.get(key);
      if (!s) return;
      if (where === "new") this.show(fullName(s), [s]); else this.plots[Number(where)].series.push(s);
      this.refresh();
      this.draw(this.time);
    });
    this.refresh();
  }

  // Lets a quantity be plotted; returns its series. `at`: its value by the number of an entry; `group`: of the list.
  offer(title, name, unit, at, group = "all") {
    const made = { name, unit, at, group, title };
    this.series.set(`${title}: ${name}`, made);
    return made;
  }

  // Adds a plot of series of one unit; `limits`: lines across it.
  show(title, series, limits = []) {
    const plot = new Plot(this, title, series[0].unit, series, limits);
    this.plots.push(plot);
    this.box.append(plot.box);
    this.refresh();
  }

  remove(plot) { plot.box.remove(); this.plots.splice(this.plots.indexOf(plot), 1); this.refresh(); }

  // Forgets all plots and series.
  clear() {
    this.box.replaceChildren();
    this.plots.length = 0;
    this.series.clear();
    this.refresh();
  }

  // Lists what can be added, and to which plot: to those of its unit.
  refresh() {
    this.more.replaceChildren();
    option(this.more, "", "add a plot …");
    const groups = new Map();
    const add = (group, value, text) => {
      if (!groups.has(group)) groups.set(group, Object.assign(document.createElement("optgroup"), { label: group }));
      option(groups.get(group), value, text);
    };
    for (const [key, s] of this.series) add(s.group, `new|${key}`, s.title === s.group ? s.name : fullName(s));
    this.plots.forEach((plot, p) => {
      for (const [key, s] of this.series)
        if (s.unit === plot.unit && !plot.series.includes(s)) add(`into the plot ${plot.title}`, `${p}|${key}`, fullName(s));
    });
    this.more.append(...groups.values());
    this.more.hidden = !this.series.size;
  }

  draw(time) {
    this.time = time;
    for (const plot of this.plots) plot.draw(time);
  }
}
