// Elements from plain values. Text becomes text nodes, never markup: names come from other people.

const SVG = "http://www.w3.org/2000/svg";

/** An element: props are attributes, `class`, `dataset`, `on...` listeners, or properties where `prop:` stands before. */
export function h(tag, props, ...children) {
  return filled(document.createElement(tag), props, children);
}

/** The same in SVG. */
export function s(tag, props, ...children) {
  return filled(document.createElementNS(SVG, tag), props, children);
}

function filled(element, props, children) {
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "dataset") Object.assign(element.dataset, value);
    else if (name.startsWith("prop:")) element[name.slice(5)] = value;
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  add(element, children);
  return element;
}

/** Append nodes, texts and lists of them; null and false are nothing. */
export function add(element, ...children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
  return element;
}

/** Replace what is inside. */
export function fill(element, ...children) {
  element.replaceChildren();
  return add(element, children);
}

/** Say something to everybody: shown for a while, and read out. */
export function tell(text, seconds = 6) {
  const line = h("div", null, text);
  document.getElementById("told").append(line);
  setTimeout(() => line.remove(), seconds * 1000);
}

/** Say something to those who hear the page; who sees it sees it anyway. */
export function whisper(text) {
  const line = h("div", { class: "unseen" }, text);
  document.getElementById("told").append(line);
  setTimeout(() => line.remove(), 4000);
}

const ICONS = {
  machine: "M4 21h16M6 21V5a2 2 0 0 1 2-2h8a2 2 0 0 1 2 2v3H9v4M12 8v5l-2 2v3h6v-3l-2-2V8",
  recordings: "M3 12h3l2-7 3 14 3-11 2 7 2-3h3",
  identification: "M4 20V4M4 20h16M6 16c2-1 3-9 5-9s2 7 4 7 2-4 5-4",
  toolings: "M8 3h8v5l-1 2H9L8 8zM10 10h4v5h-4zM11 15h2v6h-2z",
  change: "M4 20V4M4 20h16M5 8c2 7 4 7 5 0 1 8 4 8 5 0 1 9 3 9 5 2",
  robots: "M5 21h8M9 21v-4M9 17a2 2 0 1 1 .1 0M8 13.2 6 8a2.2 2.2 0 1 1 3-2l7 2M16 6.5a1.8 1.8 0 1 1-.1 3.4M17 10l1.5 3M16.5 13h4v3M17.5 13v3",
  paths: "M4 20V8l8-4 8 4v12zM7 17v-6h4v4h6",
  forces: "M3 12c2-8 4-8 6 0s4 8 6 0 4-8 6 0",
  listen: "M12 3a3 3 0 0 1 3 3v6a3 3 0 0 1-6 0V6a3 3 0 0 1 3-3zM6 11v1a6 6 0 0 0 12 0v-1M12 18v3M9 21h6",
  drop: "M12 3v12M7 10l5 5 5-5M4 17v3h16v-3",
};

/** A small drawing that says nothing to those who do not see it. */
export function icon(name) {
  return s("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" }, s("path", { d: ICONS[name] }));
}

/** A verdict or a state as a pill: colour, sign and word say the same. */
export function mark(kind, word) {
  const signs = { good: "✓", doubt: "!", bad: "✕", busy: "…", idle: "–" };
  return h("span", { class: `mark ${kind}`, "data-sign": signs[kind] }, word);
}

/** Words as a sentence of their own. */
export const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;

export function note(kind, ...children) {
  return h(
    "div",
    { class: `note ${kind}` },
    children.map((child) => (typeof child === "string" ? h("p", null, child) : child)),
  );
}

export function card(title, actions, ...children) {
  return h("section", { class: "card" }, title && h("header", null, h("h2", null, title), actions), children);
}

/** The head of a view. */
export function head(title, words, ...actions) {
  document.title = `${title} · rcsa-ident`;
  return h(
    "div",
    { class: "page-head" },
    h("div", null, h("h1", null, title), words && h("p", null, words)),
    h("div", { class: "row-of-buttons" }, actions),
  );
}

/** What is shown while there is nothing: says what to do next. */
export function empty(title, words, ...actions) {
  return h(
    "div",
    { class: "empty" },
    h("h2", null, title),
    h("p", { class: "soft" }, words),
    h("div", { class: "row-of-buttons" }, actions),
  );
}

export const waiting = (words) => h("p", { class: "waiting", role: "status" }, words);

export function link(to, words, kind = "") {
  return h("a", { href: to, class: kind || null }, words);
}

/** Two or more choices, one of which holds. */
export function choices(label, options, chosen, onpick) {
  const buttons = options.map(([value, words]) =>
    h("button", { type: "button", "aria-pressed": String(value === chosen), onclick: () => pick(value) }, words),
  );
  const box = h("div", { class: "switch", role: "group", "aria-label": label }, buttons);
  function pick(value) {
    options.forEach(([each], i) => buttons[i].setAttribute("aria-pressed", String(each === value)));
    onpick(value);
  }
  return box;
}

/** Say in a cell which column it belongs to, for a phone, where each row is a card; a unit follows the switch. */
export function labelled(cell, name, unit = null) {
  const say = () => (cell.dataset.label = unit?.textContent ? `${name} [${unit.textContent}]` : name);
  say();
  if (unit?.quantity) {
    cell.quantity = say;
    cell.dataset.quantity = unit.dataset.quantity;
  }
  return cell;
}

/** What stands around the rows of a table: it scrolls inside itself, and on a phone its rows are cards; a column is {name, unit, number}. */
export function tableFrame(caption, columns, body, { tall = false } = {}) {
  const headings = columns.map((c) =>
    h("th", { scope: "col", role: "columnheader", class: c.number ? "number" : null }, c.name, c.unit && h("span", { class: "unit" }, c.unit)),
  );
  // what is said twice: laid out as cards, an element is no table any more unless its role says so
  body.setAttribute("role", "rowgroup");
  return h(
    "div",
    { class: `scrolls${tall ? " tall" : ""}`, tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: "stacks", role: "table" },
      h("caption", { class: "unseen" }, caption),
      h("thead", { role: "rowgroup" }, h("tr", { role: "row" }, headings)),
      body,
    ),
  );
}

/** A table; a column is {name, unit, number, cell(row)}. */
export function table(caption, columns, rows, { tall = false, row = null } = {}) {
  const body = rows.map((each, i) => {
    const cells = columns.map((c, k) => {
      const kind = { class: c.number ? "number" : null, scope: k === 0 ? "row" : null, role: k === 0 ? "rowheader" : "cell" };
      const unit = c.unit instanceof Node ? c.unit : c.unit && h("span", null, c.unit);
      return labelled(h(k === 0 ? "th" : "td", kind, c.cell(each, i)), c.name, unit);
    });
    return h("tr", { role: "row", ...(row ? row(each, i) : null) }, cells);
  });
  return tableFrame(caption, columns, h("tbody", null, body), { tall });
}

/** Hand a text or a blob to the person as a file. */
export function save(name, content, kind = "text/plain") {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type: kind }));
  const hidden = h("a", { href: url, download: name });
  document.body.append(hidden);
  hidden.click();
  hidden.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
