// The last 20 s of the joints and of the real-time factor.

import { listen, value } from "./channel.js";
import { element, place, section } from "./dom.js";

const SPAN = 20; // [s]
const LEFT = 74, EDGE = 12, LINE = 22; // of the numbers beside the curves, above and below them, of a line of text [px]

export function plots() {
  const angles = plot("servo angles (°)", "only-servos");
  const others = plot("other actuators (% of their ranges)", "only-others");
  const factor = plot("simulated / real time", "");
  listen("joints", (joints) => joints.angles && angles.add(turning(joints.angles), value("colours") ?? [], ...span()));
  listen("joints", (joints) => joints.angles && others.add(shares(joints.angles), value("colours") ?? [], 0, 100));
  listen("run", (run) => run && factor.add([run.factor], ["#2f9e44"], 0, 1.5));
  return section("plots", "Plots", [angles.node, others.node, factor.node], false);
}

// Of values of all joints those of the servos, which come first.
function turning(values) {
  return values.filter((_, i) => value("kinds")?.[i]?.servo ?? true);
}

// Of values of all joints those of the others, which have different units.
function shares(values) {
  const range = value("range") ?? [];
  const share = (v, i) => 100 * (v - range[i][0]) / (range[i][1] - range[i][0]);
  return values.flatMap((v, i) => (range[i] && !(value("kinds")?.[i]?.servo ?? true) ? [share(v, i)] : []));
}

function span() {
  const range = turning(value("range") ?? [[-120, 35]]);
  if (!range.length) return [-120, 35];
  return [Math.min(...range.map((r) => r[0])), Math.max(...range.map((r) => r[1]))];
}

function plot(title, kind) {
  const canvas = element("canvas", { width: 600, height: 180, role: "img", "aria-label": title });
  const box = element("figure", kind ? { class: kind } : {});
  const rows = [];
  place(box, [element("figcaption", {}, title), canvas]);
  function add(values, colours, low, high) {
    const now = performance.now() / 1e3;
    if (rows.length && rows[0][1].length !== values.length) rows.length = 0; // another robot
    rows.push([now, values]);
    while (now - rows[0][0] > SPAN) rows.shift();
    if (!canvas.offsetParent) return; // nobody looks
    draw(canvas, rows, now, colours, low, high);
  }
  return { node: box, add };
}

function draw(canvas, rows, now, colours, low, high) {
  const pen = canvas.getContext("2d");
  const { width, height } = canvas;
  const x = (time) => width - (width - LEFT) * ((now - time) / SPAN);
  const y = (value) => height - EDGE - ((value - low) / (high - low)) * (height - 2 * EDGE);
  pen.clearRect(0, 0, width, height);
  pen.font = "20px sans-serif";
  pen.fillStyle = pen.strokeStyle = "#868e96";
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  pen.lineWidth = 1;
  const middle = low < 0 && high > 0 ? 0 : 1;
  const apart = [low, high].every((end) => Math.abs(y(middle) - y(end)) >= LINE);
  for (const mark of apart ? [low, middle, high] : [low, high]) {
    pen.beginPath();
    pen.moveTo(LEFT, y(mark));
    pen.lineTo(width, y(mark));
    pen.stroke();
    pen.fillText(String(Math.round(10 * mark) / 10), LEFT - 8, y(mark));
  }
  pen.lineWidth = 3;
  rows[0][1].forEach((_, k) => {
    pen.strokeStyle = colours[k % colours.length] ?? "#333";
    pen.beginPath();
    rows.forEach(([time, values], n) => pen[n ? "lineTo" : "moveTo"](x(time), y(values[k])));
    pen.stroke();
  });
}
