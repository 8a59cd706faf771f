// Addresses after the #: #/path/with/parts?query. A view is a function (args, query, place) that fills the place and may return what ends it.
import { Problem } from "./api.js";
import { confirmed } from "./forms.js";

const routes = [];
let ends = null;
let turn = 0;
let address = "";
let unsaved = () => false;
let asked = null;

/** Say which view belongs to a pattern as `campaigns/:id`. */
export function route(pattern, section, view) {
  const names = [...pattern.matchAll(/:(\w+)/g)].map((m) => m[1]);
  const shape = new RegExp(`^${pattern.replace(/:\w+/g, "([^/]+)")}$`);
  routes.push({ shape, names, section, view });
}

export function where() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  return { path, query: new URLSearchParams(query) };
}

/** The address of a view. */
export function to(path, query = {}) {
  const search = new URLSearchParams();
  for (const [name, value] of Object.entries(query)) {
    for (const each of Array.isArray(value) ? value : [value])
      if (each !== null && each !== undefined && each !== "") search.append(name, each);
  }
  const text = search.toString();
  return `#/${path}${text ? `?${text}` : ""}`;
}

export function go(path, query) {
  location.hash = to(path, query);
}

/** Say how to find out whether the view holds edits that are nowhere else; asked before it goes. */
export function holdsEdits(found) {
  unsaved = found;
}

/** Whether the view may go: where it holds edits, the person says so, else its address stands again. */
export async function mayLeave() {
  if (!unsaved()) return true;
  asked ??= confirmed("Leave without saving?", "What you have entered here is not saved. It goes when you leave.", "Leave", "Stay here");
  const leaves = await asked;
  asked = null;
  if (!leaves) history.replaceState(null, "", address);
  return leaves;
}

window.addEventListener("beforeunload", (event) => {
  if (unsaved()) event.preventDefault();
});

const here = () => location.hash || "#/";

/** Write what a view shows into its address, without a step back for every keystroke. */
export function remember(path, query) {
  // a view that waited for an answer may have been left, or be about to: the next one's address is not its own
  if (where().path !== path || here() !== address) return;
  history.replaceState(null, "", to(path, query));
  address = here();
}

/** Write some of what a view shows into its address; what is empty stands there no more. */
export function keep(changed) {
  const { path, query } = where();
  const before = Object.fromEntries([...query.keys()].map((name) => [name, query.getAll(name)]));
  remember(path, { ...before, ...changed });
}

/** Show the view of the address now. */
export async function show(place, onshow, onerror) {
  const mine = (turn += 1);
  const { path, query } = where();
  ends?.();
  ends = null;
  address = here();
  holdsEdits(() => false);
  for (const { shape, names, section, view } of routes) {
    const found = shape.exec(path);
    if (!found) continue;
    const args = Object.fromEntries(names.map((name, i) => [name, decode(found[i + 1])]));
    // views that take time fill a place of their own: one that was left does not overwrite the next one
    const own = document.createElement("div");
    own.className = "view";
    place.replaceChildren(own);
    onshow(section, args, query);
    let end = null;
    try {
      end = await view(args, query, own);
    } catch (error) {
      if (mine === turn) onerror(own, error);
    }
    if (mine === turn) ends = typeof end === "function" ? end : null;
    else if (typeof end === "function") end();
    return;
  }
  onshow("", {}, query);
  onerror(place, new Problem(0, { detail: "There is no such page." }));
}

function decode(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
