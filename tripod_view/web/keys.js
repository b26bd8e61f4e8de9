// The keys of `tripod teleop`, here with presses and releases. They work wherever the pointer is.

import { send, value } from "./channel.js";

const REPEAT = 100; // the node takes keys as released if it hears nothing for 300 ms
const MOVES = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1],
  "+": [2, 1], "=": [2, 1], "-": [2, -1], _: [2, -1],
};
const PRESSES = { t: "TELEOP", b: "TELEOP", i: "IK", a: "working pose", p: "park" };

export function keys() {
  const down = new Map();
  const tell = () => {
    const signs = [0, 0, 0];
    for (const [servo, sign] of down.values()) signs[servo] = Math.sign(signs[servo] + sign);
    send({ keys: signs });
  };
  setInterval(() => down.size && tell(), REPEAT);
  const release = () => {
    if (!down.size) return;
    down.clear();
    tell();
  };
  window.addEventListener("blur", release);
  // In the capture phase: the camera of the 3-D view, too, moves by arrows.
  window.addEventListener("keydown", (event) => {
    if (event.key === " " || event.key === "Escape") {
      release();
      send({ press: "STOP" });
      event.preventDefault();
      event.stopPropagation();
      return;
    }
    if (event.altKey || event.metaKey || typing(event.target) || !value("scene")?.servos) return;
    const move = MOVES[event.key];
    const press = PRESSES[event.key.toLowerCase()];
    if (!move && !press) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.repeat) return;
    if (press) send({ press });
    else {
      down.set(event.code, move);
      tell();
    }
  }, true);
  window.addEventListener("keyup", (event) => {
    if (down.delete(event.code)) tell();
  }, true);
}

function typing(node) {
  return node instanceof HTMLInputElement; // arrows belong to the slider or number that has the focus
}
