// The websocket of the panel: values by name in, events out. It is opened again when it is lost.

const AGAIN = 1000; // pause before the next attempt [ms]

const listeners = {};
const values = {};
let socket = null;

export function listen(name, heard) {
  (listeners[name] ??= []).push(heard);
  if (name in values) heard(values[name]);
}

export function value(name) {
  return values[name];
}

export function send(event) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(event));
}

function take(name, content) {
  values[name] = content;
  for (const heard of listeners[name] ?? []) heard(content);
}

function open() {
  const folder = new URL(".", import.meta.url); // ends in /TOKEN/page/
  socket = new WebSocket(`ws://${folder.host}${folder.pathname}channel`);
  socket.addEventListener("open", () => take("connected", true));
  socket.addEventListener("message", (message) => {
    for (const [name, content] of Object.entries(JSON.parse(message.data))) take(name, content);
  });
  socket.addEventListener("close", () => {
    take("connected", false);
    setTimeout(open, AGAIN);
  });
}

open();
