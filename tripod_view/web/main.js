// The panel beside the 3-D scene: values come from the page's node by name, what people do goes back as events.

import { listen, send } from "./channel.js";
import { element, place } from "./dom.js";
import { controls } from "./controls.js";
import { cards } from "./cards.js";
import { hands } from "./hands.js";
import { keys } from "./keys.js";
import { tellPicked } from "./picked.js";
import { plots } from "./plots.js";
import { replay } from "./replay.js";
import { scene } from "./scene.js";
import { noPicture, start } from "./start.js";
import { status } from "./status.js";

const panel = element("aside", { id: "panel", "aria-label": "Controls" });
const stop = element("button", { id: "stop", title: "All commands off: the robot holds, then moves to its park pose (Space, Esc)" }, "STOP");
stop.addEventListener("click", () => send({ press: "STOP" }));

const view = scene(), { card, plotNode } = plots(view);
place(panel, [status(), controls(), hands(view), replay(), cards(), card]);
if (view) tellPicked(view, plotNode);
place(document.body, [panel, stop, start(), view ? null : noPicture(), element("div", { id: "lost" }, "connection lost: trying again. If the program was started again, open the address that its terminal shows")]);
keys();

// What a scene has decides which controls there are: classes of the body, which the style sheet heeds.
listen("scene", (scene) => {
  document.title = scene.name ? `${scene.name} - Tripod` : "Tripod";
  for (const name of ["joints", "target", "ball", "maze", "known"]) {
    document.body.classList.toggle(`has-${name}`, Boolean(scene[name]));
  }
});
listen("kinds", (kinds) => { // of servos and of other joints each
  document.body.classList.toggle("has-servos", kinds.some((kind) => kind.servo));
  document.body.classList.toggle("has-others", kinds.some((kind) => !kind.servo));
});
listen("connected", (connected) => document.body.classList.toggle("lost", !connected));
