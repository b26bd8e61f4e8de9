// Buttons of the simulation, sliders of the joints with what these give in return, the target.

import { listen, send, value } from "./channel.js";
import { button, element, place, section, setText, showLines } from "./dom.js";

const STEP = 0.5; // of the sliders [degrees]
const FIRST = "Press Drive by sliders and keys first"; // why a slider does not move

export function controls() {
  return place(element("div"), [simulation(), joints(), target()]);
}

function simulation() {
  const pause = button("Pause", () => send({ sim: value("run")?.state === 1 ? "run" : "pause" }));
  pause.id = "pause";
  const record = button("Record", () => send({ press: value("recording")?.on ? "stop recording" : "record" }));
  record.id = "record";
  const told = element("p", { class: "small", id: "recording" });
  const step = button("Step", () => send({ sim: "step" }));
  const row = place(element("div", { class: "row" }), [
    button("Reset", () => send({ sim: "reset" }), "Start again: bodies, ball and joints as at first; a real robot stops"),
    pause,
    step,
    withClass("ball", button("Drop the ball", () => send({ sim: "drop" }), "The ball again to where it starts")),
    record,
  ]);
  listen("run", (run) => {
    setText(pause, run?.state === 1 ? "Run" : "Pause");
    step.disabled = run?.state !== 1;
    step.title = step.disabled ? "One step: press Pause first" : "One step";
  });
  listen("recording", ({ possible, on, text }) => {
    record.disabled = !possible;
    record.title = possible ? "Record all topics" : "";
    setText(record, on ? "Stop recording" : "Record");
    setText(told, text || (possible ? "" : "To record, start with tripod up --record DIR."));
  });
  return section("simulation", "Simulation", [row, told]);
}

function withClass(name, made) {
  made.classList.add(`only-${name}`);
  return made;
}

function joints() {
  const drive = button("Drive by sliders and keys", () => send({ press: "TELEOP" }), "Key t");
  drive.id = "drive";
  const follow = withClass("target", button("Follow the green target", () => send({ press: "IK" }), "Key i"));
  const rows = element("div");
  listen("range", (range) => { // a slider for each joint; those of a scene that had more are hidden
    while (rows.children.length < range.length) rows.append(joint(rows.children.length));
    [...rows.children].forEach((row, i) => (row.style.display = i < range.length ? "" : "none"));
  });
  const slide = slideRow();
  const work = withClass("servos", button("Working pose", () => send({ press: "working pose" }), "A slow motion; key a"));
  const motions = place(element("div", { class: "row" }), [
    work,
    button("Park pose", () => send({ press: "park" }), "A slow motion; key p"),
  ]);
  listen("mode", ({ mode, own }) => {
    drive.classList.toggle("on", own && mode === "TELEOP");
    follow.classList.toggle("on", own && mode === "IK");
  });
  const choice = place(element("div", { class: "row" }), [drive, follow]);
  const note = element("p", { class: "small" });
  const card = section("joints", "Servos", [choice, rows, slide, motions, note]);
  listen("kinds", (kinds) => { // of servos alone, or of any actuators
    const all = kinds.every((kind) => kind.servo), some = kinds.some((kind) => kind.servo);
    setText(card.querySelector("summary"), all ? "Servos" : "Actuators");
    setText(note, `Keys: arrows and + - move ${all ? "servos" : "actuators"}, 0 to 9 choose that of + -, t drive, i follow, ${some ? "a working pose, " : ""}p park pose, Space or Esc STOP.`);
  });
  return withClass("joints", card);
}

// A slider moves as long as a hand holds it; else it shows what is asked for.
function held(input) {
  let down = false;
  input.addEventListener("pointerdown", () => (down = true));
  for (const name of ["pointerup", "pointercancel", "blur"]) input.addEventListener(name, () => (down = false));
  input.addEventListener("pointerup", () => input.blur()); // the arrows move joints again
  return () => down;
}

function joint(i) {
  const row = element("div", { class: "servo" });
  const slider = element("input", { type: "range", step: STEP, "aria-label": `servo ${i} (degrees)`, disabled: "" });
  const number = element("input", { type: "number", step: STEP, "aria-label": `servo ${i}, typed (degrees)`, disabled: "" });
  const torque = element("span", { class: "torque" });
  const bar = element("meter", { min: 0, max: 1, low: 0.7, high: 0.9, optimum: 0, "aria-label": `torque of servo ${i}` });
  const name = element("label", {}, `servo ${i}`), unit = element("span", { class: "unit" }, "°");
  const kind = () => (value("kinds") ?? [])[i] ?? { name: `servo ${i}`, unit: "°", step: STEP, digits: 1, back: "N m", servo: true };
  const move = (text) => send(kind().servo ? { servo: i, degrees: Number(text) } : { joint: i, value: Number(text) });
  const limit = ([low, high]) => {
    const { step, unit: shown, servo: turns } = kind();
    [slider.min, slider.max] = [Math.ceil(low / step) * step, Math.floor(high / step + 1e-6) * step];
    number.title = `${low} to ${high} ${turns ? "degrees" : shown}`;
  };
  const isHeld = held(slider);
  slider.addEventListener("input", () => move(slider.value));
  number.addEventListener("change", () => number.value && move(number.value)); // "" is no 0
  number.addEventListener("keydown", (event) => event.key === "Enter" && number.blur());
  number.addEventListener("blur", () => show(value("joints"))); // what is asked for, whatever was typed
  listen("colours", (colours) => {
    name.style.color = colours[i % colours.length];
    slider.style.accentColor = colours[i % colours.length];
  });
  listen("range", (range) => {
    if (i >= range.length) return;
    limit(range[i]);
  });
  listen("kinds", (kinds) => {
    if (i >= kinds.length) return;
    const { name: text, unit: shown, step, servo: turns } = kinds[i];
    setText(name, turns ? text : `${text} (${shown})`);
    setText(unit, shown);
    row.classList.toggle("other", !turns);
    slider.step = number.step = step;
    slider.setAttribute("aria-label", `${text} (${turns ? "degrees" : shown})`);
    number.setAttribute("aria-label", `${text}, typed (${turns ? "degrees" : shown})`);
    if (value("range")?.[i]) limit(value("range")[i]);
  });
  const show = (joints) => {
    if (i >= joints.asked.length) return;
    slider.disabled = number.disabled = !joints.enabled;
    slider.title = joints.enabled ? "" : FIRST;
    if (!isHeld()) slider.value = joints.asked[i];
    if (document.activeElement !== number) number.value = joints.asked[i].toFixed(kind().digits);
    const stall = kind().servo ? value("scene")?.stall_torque : null;
    if (!joints.torques || i >= joints.torques.length) {
      setText(torque, kind().servo ? "torque not known" : "not known");
      bar.value = 0;
      return;
    }
    const load = joints.torques[i];
    setText(torque, stall ? `${load.toFixed(3)} of ${stall} N m` : `${load.toFixed(3)} ${kind().back}`);
    torque.classList.toggle("bad", Boolean(stall) && Math.abs(load) > stall);
    bar.value = stall ? Math.min(Math.abs(load) / stall, 1) : 0;
  };
  listen("joints", show);
  listen("kinds", () => value("joints") && show(value("joints"))); // in the units of these
  return place(row, [name, slider, number, unit, bar, torque]);
}

function slideRow() {
  const slider = element("input", { type: "range", min: 0, step: 0.5, "aria-label": "slide (mm)", disabled: "" });
  const text = element("span", { class: "torque" });
  const isHeld = held(slider);
  slider.addEventListener("input", () => send({ slide: Number(slider.value) }));
  listen("scene", (scene) => (slider.max = scene.slide_max || 40));
  listen("joints", (joints) => {
    slider.disabled = !joints.enabled;
    if (joints.slide !== null && !isHeld()) slider.value = joints.slide;
    setText(text, joints.slide === null ? "not known" : `${joints.slide.toFixed(1)} mm`);
  });
  const row = element("div", { class: "servo slide", title: "All servo bodies move inward; the real robot has no such motor" });
  return withClass("servos", place(row, [element("label", {}, "slide"), slider, text]));
}

function target() {
  const lines = element("div");
  listen("target", (content) => showLines(lines, content));
  const fetch = button("Bring target to effector", () => send({ press: "bring target to effector" }));
  return withClass("target", section("target", "Target", [lines, fetch], false));
}
