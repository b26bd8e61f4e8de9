"use strict";
// The buttons over the picture, and what else the page of a run and the live page have in common.

const BACKGROUND = "#edf1f4"; // of a saved picture

const TOOLS = { // what stands on a button, and what it does
  home: ["Reset view", "the view at first"], fit: ["Fit", "show all, from here"], top: ["Top", "from above"],
  front: ["Front", "from the front"], side: ["Side", "from the side"], below: ["Below", "let the camera below the floor"],
  lines: ["Mesh", "lines of the mesh"], path: ["Path", "the path of what moves"],
  forces: ["Forces", "the forces on the bodies"],
  pull: ["Pull", "drag a body by the mouse"],
  shot: ["Save picture", "save a picture as PNG"], panel: ["Plots", "show or hide the plots"],
  aside: ["Panel", "show or hide the panel"], help: ["?", "keys and mouse"],
};
const SWITCHES = ["below", "lines", "path", "forces", "pull", "panel", "aside"]; // stay pressed

const byId = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

function length(metres) {
  const short = (v) => String(Number(v.toPrecision(3)));
  return metres >= 1 ? `${short(metres)} m` : metres >= 0.001 ? `${short(1000 * metres)} mm` : `${short(1e6 * metres)} um`;
}

// A place [m] in words, in a scene of that radius [m].
function placed(place, radius) {
  const digits = clamp(Math.round(-Math.log10(radius)), 0, 6);
  return ["x", "y", "z"].map((axis, a) => `${axis} ${(1e3 * place[a]).toFixed(digits).replace(/^-(?=[0.]+$)/, "")}`).join(", ") + " mm";
}

// Saves a file and returns its name; what that should not have in a terminal becomes a dash.
function save(title, blob) {
  const name = title.replace(/[^\p{L}\p{N}._-]+/gu, "-");
  const link = document.createElement("a");
  Object.assign(link, { href: URL.createObjectURL(blob), download: name }).click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  return name;
}

function option(select, value, text) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  select.append(made);
}

function pressed(id, on) { byId(id).setAttribute("aria-pressed", String(on)); }

// Adds buttons to `box`: of `actions`, functions by name in TOOLS; `keys`: the key of each that has one.
function addTools(box, actions, keys) {
  for (const [id, act] of Object.entries(actions)) {
    const [label, title] = TOOLS[id], button = document.createElement("button");
    Object.assign(button, { id, textContent: label, title: keys[id] ? `${title} (${keys[id]})` : title });
    button.addEventListener("click", act);
    box.append(button);
    if (SWITCHES.includes(id)) pressed(id, ["panel", "aside"].includes(id));
  }
}

// What the buttons of the camera do.
function cameraActions(view) {
  const from = (name) => () => view.from(name);
  return {
    home: () => view.home(), fit: () => view.fit(), top: from("top"), front: from("front"), side: from("side"),
    below: () => { view.below = !view.below; pressed("below", view.below); view.moved(); },
  };
}

// Opens or closes the sheet of keys; `modal`: the rest of the page cannot be used meanwhile.
function toggleSheet(modal) {
  const sheet = byId("sheet");
  if (sheet.open) sheet.close();
  else if (modal) sheet.showModal();
  else {
    sheet.style.top = `${byId("seen").getBoundingClientRect().bottom + 4}px`; // the button that closes it stays in reach
    sheet.show();
  }
}

// Calls `heard` with what a click on the picture picks, or null; the end of a drag is none.
function onPick(view, heard) {
  let down = null;
  view.canvas.addEventListener("pointerdown", (e) => { down = [e.clientX, e.clientY]; });
  view.canvas.addEventListener("pointerup", (e) => {
    if (down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) <= 4) heard(view.pick(e));
    down = null;
  });
}

// Lets `bar` be dragged: `sized` gets the width that is right of it [px].
function splitAt(bar, sized) {
  bar.addEventListener("pointerdown", (e) => {
    bar.setPointerCapture(e.pointerId);
    bar.onpointermove = (m) => sized(Math.min(Math.max(innerWidth - m.clientX, 160), 0.8 * innerWidth));
    bar.onpointerup = () => { bar.onpointermove = null; };
  });
}
