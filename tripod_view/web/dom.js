// Small helpers to build the panel. Texts are set as texts, never as HTML: some come from the network.

export function element(tag, attributes = {}, text = "") {
  const made = document.createElement(tag);
  for (const [name, content] of Object.entries(attributes)) made.setAttribute(name, content);
  if (text) made.textContent = text;
  return made;
}

export function place(parent, children) {
  parent.append(...children.filter(Boolean));
  return parent;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function button(label, pressed, title = "") {
  const made = element("button", title ? { title } : {}, label);
  made.addEventListener("click", pressed);
  return made;
}

// A part of the panel that opens and closes.
export function section(name, title, children, open = true) {
  const made = element("details", { id: name, class: "card" });
  made.open = open;
  return place(made, [element("summary", {}, title), ...children]);
}

export function line({ light, who, text }) {
  const row = element("div", { class: `line ${light}` });
  return place(row, [element("b", {}, who), element("span", {}, text)]);
}

// Lines are replaced only where they changed: a text that is being read stays.
export function showLines(parent, lines) {
  const before = [...parent.children];
  lines.forEach((content, i) => {
    const old = before[i];
    if (!old) parent.append(line(content));
    else {
      if (old.className !== `line ${content.light}`) old.className = `line ${content.light}`;
      setText(old.firstChild, content.who);
      setText(old.lastChild, content.text);
    }
  });
  before.slice(lines.length).forEach((old) => old.remove());
}

export function milli(seconds) {
  return `${(1e3 * seconds).toPrecision(3)} ms`;
}

// Decimals that tell steps of so many seconds apart.
export function decimals(dt) {
  return Math.min(6, Math.max(1, Math.ceil(-Math.log10(dt) - 1e-9)));
}

export function percent(share) {
  return `${Number((100 * share).toPrecision(2))} %`;
}

export function svg(tag, attributes = {}, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, content] of Object.entries(attributes)) made.setAttribute(name, content);
  if (text) made.textContent = text;
  return made;
}
