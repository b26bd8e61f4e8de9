// Title, who commands, how the simulation runs, and what happened to the ball.

import { listen, value } from "./channel.js";
import { decimals, element, milli, place, section, setText, showLines } from "./dom.js";

const STATES = ["running", "paused", "holds", "parked", "failed"];

export function status() {
  const title = element("h1", {}, "Tripod");
  const about = element("p", { class: "about" });
  const badge = element("span", { id: "simulated", class: "badge" }, "simulated: no robot connected");
  const run = element("p", { id: "run" });
  const event = element("p", { id: "event", role: "status", hidden: "" });
  const mode = element("div", { id: "mode" });
  const notice = element("div", { id: "notice", role: "status" });
  const notes = element("div", { id: "notes" });
  const lines = element("div", { id: "node-lines" });

  listen("scene", (scene) => {
    setText(title, scene.name || "Tripod");
    setText(about, [scene.description, scene.note].filter(Boolean).join(" - "));
  });
  listen("mode", (content) => showLines(mode, [content]));
  const note = () => {
    const own = value("notice") ?? [];
    const told = value("figures")?.notice ?? "";
    showLines(notice, own.length || !told ? own : [{ light: "watch", who: "Simulator", text: told }]);
  };
  listen("notice", note);
  listen("status", (content) => showLines(lines, content));
  const silent = element("div", { id: "silent" }, "the simulator is not heard: this is its last picture");
  document.body.append(silent);
  const hush = () => document.body.classList.toggle("silent", value("run") === null && Boolean(value("scene")?.known));
  listen("scene", hush);
  listen("run", hush);
  listen("run", (content) => {
    badge.hidden = content ? !content.simulated : false;
    if (!content) {
      setText(run, "the simulator is not heard");
      return;
    }
    const error = content.effector_time_error ?? content.time_error;
    const parts = [
      `${STATES[content.state] ?? "?"} at ${content.time.toFixed(decimals(content.dt))} s`,
      content.state === 1 ? "" : `${content.factor.toFixed(2)} x real time${content.speed && content.speed !== 1 ? ` (chosen: ${content.speed} x)` : ""}`,
      `step ${milli(content.step)} (p99 ${milli(content.p99)}) of ${milli(content.dt)}`,
    ];
    if (error !== null) parts.push(`time steps err by ${(1e3 * error).toPrecision(2)} mm`);
    setText(run, parts.filter(Boolean).join(" · "));
    run.className = content.state === 4 ? "bad" : "";
  });
  listen("figures", (figures) => {
    const text = figures?.event ?? "";
    event.hidden = !text;
    event.className = text.startsWith("goal") ? "good" : "bad";
    setText(event, text);
    note();
    showLines(notes, (figures?.notes ?? []).map((said) => ({ light: "watch", who: "Scene", text: said })));
  });

  const top = element("header");
  const messages = place(element("div", { id: "messages" }), [mode, event, notice, notes]);
  place(top, [title, badge, about, run, messages]);
  const box = element("div");
  return place(box, [top, section("status", "Nodes", [lines], false)]);
}
