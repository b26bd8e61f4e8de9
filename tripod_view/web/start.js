// The start screen: what this is, who moves the robot, and one thing to begin with.

import { listen, send, value } from "./channel.js";
import { button, element, place, setText } from "./dom.js";

const MOVED = {
  TELEOP: "It is moved by hand at the moment, from a terminal or another page.",
  IK: "It moves by itself at the moment: the inverse kinematics follows a target.",
  REPLAY: "It moves by itself at the moment: a script is being played.",
};

export function start() {
  const box = element("section", { id: "start" });
  const title = element("h2");
  const text = element("p");
  const moved = element("p", { id: "moved" });
  const begin = button("", () => {
    for (const event of actions(value("scene"))) send(event);
    box.remove();
  });
  begin.id = "begin";
  const watch = button("Just watch", () => box.remove());
  watch.className = "quiet";
  const show = () => {
    const scene = value("scene") ?? {}, by = scene.joints ? MOVED[value("mode")?.mode] : undefined;
    setText(moved, by ? `${by} ${taken(scene)}` : "");
    setText(begin, by && !scene.maze ? "Take over and move it" : label(scene));
    setText(watch, by ? "Just watch" : "Just watch");
    box.classList.toggle("aside", Boolean(by));
  };
  listen("scene", (scene) => {
    setText(title, scene.name || "Tripod");
    const there = scene.known || scene.joints;
    setText(text, scene.description || (there ? "" : "Waiting for the simulator: it may compile for a minute the first time."));
    begin.style.display = there ? "" : "none";
    show();
  });
  listen("mode", show);
  return place(box, [title, text, moved, begin, watch]);
}

// What to do where the browser cannot draw.
export function noPicture() {
  const text = "This browser has no WebGL 2, so the view stays white. Switch on hardware acceleration in its settings, or open this page in another browser (Firefox, Chrome).";
  return element("p", { id: "no-webgl" }, text);
}

function label(scene) {
  if (scene.maze) return "Play: tilt the maze";
  if (scene.joints) return "Move the robot";
  return "Watch it from the start";
}

function taken(scene) {
  if (scene.maze) return "Playing ends that.";
  if (!works()) return "Taking over ends that.";
  return "Taking over ends that, and the robot goes slowly to its working pose.";
}

function actions(scene) {
  if (!scene) return [];
  if (!scene.joints) return [{ sim: "reset" }];
  return [{ press: works() ? "working pose" : "TELEOP" }];
}

// Whether there is a working pose: one of servos.
function works() {
  return (value("kinds") ?? []).some((kind) => kind.servo);
}
