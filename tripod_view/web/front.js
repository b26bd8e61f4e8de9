// Error against time of the settings that were studied, the best of them joined, and where this run is.

import { element, percent, place, svg } from "./dom.js";

const [WIDTH, HEIGHT, LEFT, BOTTOM] = [320, 170, 54, 26];

export function front(figures, seconds) {
  const points = [...figures.dots];
  const here = seconds && figures.measured !== null ? [seconds, figures.measured] : null;
  const all = (here ? [...points, here] : points).filter(([x, y]) => x > 0 && y > 0);
  const x = scale(all.map((p) => p[0]), LEFT, WIDTH - 8);
  const y = scale(all.map((p) => Math.max(p[1], 1e-6)), HEIGHT - BOTTOM, 10);
  const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "error against time" });
  for (const mark of x.marks) {
    picture.append(svg("line", { x1: x(mark), x2: x(mark), y1: 10, y2: HEIGHT - BOTTOM, class: "grid" }));
    picture.append(svg("text", { x: x(mark), y: HEIGHT - 12, "text-anchor": "middle" }, power(mark)));
  }
  for (const mark of y.marks) {
    picture.append(svg("line", { x1: LEFT, x2: WIDTH - 8, y1: y(mark), y2: y(mark), class: "grid" }));
    picture.append(svg("text", { x: LEFT - 4, y: y(mark) + 3, "text-anchor": "end" }, percent(mark)));
  }
  if (!figures.solves && x.low < 1 && x.high > 1) {
    picture.append(svg("line", { x1: x(1), x2: x(1), y1: 10, y2: HEIGHT - BOTTOM, class: "real" }));
    picture.append(svg("text", { x: x(1) - 3, y: 18, "text-anchor": "end" }, "real time"));
  }
  for (const [a, b] of points) picture.append(svg("circle", { cx: x(a), cy: y(Math.max(b, 1e-6)), r: 1.6, class: "dot" }));
  const path = figures.front.map(([a, b], i) => `${i ? "L" : "M"}${x(a)} ${y(Math.max(b, 1e-6))}`).join("");
  picture.append(svg("path", { d: path, class: "front" }));
  if (here) {
    const place = { cx: x(here[0]), cy: y(here[1]) };
    picture.append(svg("circle", { ...place, r: 5, class: "here" }));
    const left = place.cx > WIDTH - 90;
    picture.append(svg("text", { x: place.cx + (left ? -8 : 8), y: place.cy + 3, class: "you", "text-anchor": left ? "end" : "start" }, "you are here"));
  }
  const unit = figures.solves ? "s for a solve" : "s for a simulated second";
  picture.append(svg("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 1, "text-anchor": "middle" }, unit));
  return place(element("figure"), [picture]);
}

// Logarithmic; with the powers of ten within, at most about five of them, or both ends where there is none.
function scale(values, from, to) {
  const low = Math.min(...values);
  const high = Math.max(...values, low * 1.01);
  const [a, b] = [Math.log10(low), Math.log10(high)];
  const map = (value) => from + ((Math.log10(value) - a) / (b - a)) * (to - from);
  const every = Math.max(1, Math.ceil((b - a) / 5));
  map.marks = [];
  for (let k = Math.ceil(a); k <= b; k++) if (k % every === 0) map.marks.push(10 ** k);
  if (!map.marks.length) map.marks.push(low, high);
  [map.low, map.high] = [low, high];
  return map;
}

function power(value) {
  return value >= 0.01 && value < 1e4 ? String(Number(value.toPrecision(1))) : value.toExponential(0);
}
