// The keys of `tripod teleop`, here with presses and releases. They work wherever the pointer is.

import { send, value } from "./channel.js";

const REPEAT = 100; // the node takes keys as released if it hears nothing for 300 ms
const MOVES = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1],
};
const SIGNS = { "+": 1, "=": 1, "-": -1, _: -1 }; // of the chosen joint
const PRESSES = { t: "TELEOP", b: "TELEOP", i: "IK", a: "working pose", p: "park" };

export function keys() {
  const down = new Map();
  let chosen = 2;
  const tell = () => {
    const signs = (value("range") ?? []).map(() => 0);
    for (const [joint, sign] of down.values()) if (joint < signs.length) signs[joint] = Math.sign(signs[joint] + sign);
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
      if (event.key === " " || !closeWhatIsOpen()) {
        release();
        send({ press: "STOP" });
      }
      event.preventDefault();
      event.stopPropagation();
      return;
    }
    if (event.altKey || event.metaKey || typing(event.target) || !value("scene")?.joints) return;
    const move = event.key in SIGNS ? [chosen, SIGNS[event.key]] : MOVES[event.key];
    if (/^[0-9]$/.test(event.key) && Number(event.key) < (value("range") ?? []).length) {
      chosen = Number(event.key);
      event.preventDefault();
      event.stopPropagation();
      return;
    }
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
    if (event.key === " ") event.preventDefault(); // some browsers press the button that has the focus: after STOP
    if (down.delete(event.code)) tell();
  }, true);
}

// Closes the sheet of keys, or else the text of a set; returns whether one was open.
function closeWhatIsOpen() {
  const sheet = byId("sheet"), text = byId("set"), open = sheet.open || !text.hidden;
  if (sheet.open) sheet.close(); else text.hidden = true;
  return open;
}

function typing(node) {
  return node instanceof HTMLInputElement; // arrows belong to the slider or number that has the focus
}
