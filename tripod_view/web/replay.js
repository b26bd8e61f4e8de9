// The last half minute again: the 3-D view shows the past, while the simulation goes on.

import { listen, send } from "./channel.js";
import { button, element, place, section, setText } from "./dom.js";

export function replay() {
  const slider = element("input", { type: "range", min: -30, max: 0, step: 0.1, value: 0, "aria-label": "seconds back" });
  const text = element("span", { class: "torque" }, "now");
  const play = button("Replay", () => send({ replay: -Number(slider.min), running: true }), "All that is kept, once");
  const now = button("Now", () => send({ replay: null }));
  now.disabled = true;
  slider.addEventListener("input", () => send({ replay: -Number(slider.value), running: false }));
  listen("replay", ({ length, age, running }) => {
    slider.min = -Math.max(length, 0.1);
    if (document.activeElement !== slider || running || age === null) slider.value = age === null ? 0 : -age;
    now.disabled = age === null;
    now.title = age === null ? "This is the present" : "Back to the present";
    document.body.classList.toggle("past", age !== null);
    setText(text, age === null ? "now" : `${age.toFixed(1)} s ago`);
  });
  const row = place(element("div", { class: "servo slide" }), [element("label", {}, "past"), slider, text]);
  const box = section("replay", "Replay", [row, place(element("div", { class: "row" }), [play, now])], false);
  const banner = element("div", { id: "past" }, "the past: the simulation goes on behind it");
  document.body.append(banner);
  return box;
}
