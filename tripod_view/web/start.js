// The start screen: what this is, and one thing to begin with.

import { listen, send, value } from "./channel.js";
import { button, element, place, setText } from "./dom.js";

export function start() {
  const box = element("section", { id: "start" });
  const title = element("h2");
  const text = element("p");
  const begin = button("", () => {
    for (const event of actions(value("scene"))) send(event);
    box.remove();
  });
  begin.id = "begin";
  const watch = button("Just watch", () => box.remove());
  watch.className = "quiet";
  listen("scene", (scene) => {
    setText(title, scene.name || "Tripod");
    const there = scene.known || scene.servos;
    setText(text, scene.description || (there ? "" : "Waiting for the simulator: it may compile for a minute the first time."));
    setText(begin, label(scene));
    begin.style.display = there ? "" : "none";
  });
  return place(box, [title, text, begin, watch]);
}

function label(scene) {
  if (scene.maze) return "Play: tilt the maze";
  if (scene.servos) return "Move the robot";
  return "Watch it from the start";
}

function actions(scene) {
  if (!scene) return [];
  if (!scene.servos) return [{ sim: "reset" }];
  return [{ press: "working pose" }];
}
