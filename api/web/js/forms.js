// Fields with their labels, hints and faults, and problem documents put beside the fields that they name.
import { h, note, tell } from "./dom.js";
import { kindOf, quantityInput, u } from "./units.js";

let count = 0;

/** A field: `name` is what the service calls it, so that its faults find it; `double` where long names have to be read in it. */
export function field(label, input, { name = "", hint = "", unit = "", double = false } = {}) {
  const id = input.id || `f${(count += 1)}`;
  input.id = id;
  const fault = h("div", { class: "fault", id: `${id}-fault`, hidden: true });
  const told = hint ? h("div", { class: "hint", id: `${id}-hint` }, hint) : null;
  // a fault that is told there is read with the field
  input.setAttribute("aria-describedby", hint ? `${id}-hint ${id}-fault` : `${id}-fault`);
  const control = unit
    ? h("div", { class: "with-unit" }, input, h("span", { class: "unit" }, typeof unit === "string" ? u(unit) : unit))
    : input;
  return h("div", { class: double ? "field double" : "field", "data-field": name || null }, h("label", { for: id }, label), control, told, fault);
}

/** A field for a quantity; its input is `.input`. */
export function quantity(label, kind, value, options = {}) {
  const input = quantityInput(kind, value, options.props);
  const box = field(label, input, { ...options, unit: kind === "none" ? "" : kind });
  box.input = input;
  return box;
}

/** A quantity of a declared key of a noun. */
export const declaredField = ({ key, label, unit, hint }, noun, value, props = {}) =>
  quantity(label, kindOf(unit), value ?? null, { name: `${noun}.${key}`, hint, props });

/** A choice from a list of [value, words]: the first one where none of them is chosen. */
export function select(options, chosen, props = {}) {
  return h(
    "select",
    props,
    options.map(([value, words]) => h("option", { value, selected: value === chosen }, words)),
  );
}

const plainName = (name) => name.replace(/\[(\d+)\]/g, ".$1");

/** Take all faults away. */
export function clearFaults(form) {
  for (const fault of form.querySelectorAll(".fault")) {
    fault.hidden = true;
    fault.replaceChildren();
  }
  for (const input of form.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
  form.querySelector(":scope > .form-fault")?.remove();
}

/**
 * Show a problem in a form: beside each field that it names, and what belongs to no field at the top.
 * Returns whether a field was found. `focus` moves there.
 */
export function showProblem(form, problem, { focus = true } = {}) {
  clearFaults(form);
  let first = null;
  const homeless = [];
  for (const { field: name, found, allowed } of problem.errors ?? []) {
    const boxes = placesOf(form, name);
    const words = found && found !== "nothing" ? `${said(allowed)} Found: ${found}.` : said(allowed);
    if (!boxes.length) homeless.push(`${name}: ${words}`);
    for (const box of boxes) {
      // a fault in something folded away is no help
      for (let outer = box.closest("details"); outer; outer = outer.parentElement.closest("details")) outer.open = true;
      const input = box.matches("input, select, textarea") ? box : box.querySelector("input, select, textarea");
      const fault = box.querySelector(".fault") ?? box.parentElement.querySelector(".fault");
      if (fault) {
        fault.hidden = false;
        fault.append(h("div", null, words));
        input?.setAttribute("aria-errormessage", fault.id);
      }
      input?.setAttribute("aria-invalid", "true");
      first ??= input;
    }
  }
  if (!first || homeless.length) {
    const lines = homeless.length ? homeless : [problem.message];
    form.prepend(h("div", { class: "form-fault", role: "alert" }, note("bad", ...lines)));
  }
  if (first && focus) first.focus();
  if (first) announce(first);
  return first !== null;
}

function announce(input) {
  const label = input.labels?.[0]?.textContent ?? input.getAttribute("aria-label") ?? "a field";
  tell(`Not usable: ${label}`, 3);
}

function said(text) {
  const words = text.replace(/^Input should be/, "It should be").replace(/^Field required$/, "Something is needed here.");
  const whole = /^[a-z0-9+]/.test(words) ? `Allowed: ${words}` : words;
  return /[.!?]$/.test(whole) ? whole : `${whole}.`;
}

/** Fields of a name, or of the names that it joins, or of what stands around it. */
function placesOf(form, name) {
  const known = [...form.querySelectorAll("[data-field]")];
  const exact = (wanted) => known.filter((box) => box.dataset.field === wanted);
  const wanted = plainName(name);
  let found = exact(wanted);
  if (!found.length && wanted.includes(" + ")) found = wanted.split(" + ").flatMap(exact);
  // pydantic names the members of a choice, too: toolings.0.ToolingKeys.cutter.teeth
  if (!found.length)
    found = exact(
      wanted
        .split(".")
        .filter((p) => !/^[A-Z]|\(/.test(p))
        .join("."),
    );
  if (!found.length) found = known.filter((box) => wanted.endsWith(`.${box.dataset.field}`)).slice(0, 1);
  return found;
}

/** Show any error of an action where it was asked for. */
export function failed(place, error) {
  if (error?.name === "AbortError") return;
  if (place.matches?.("form")) showProblem(place, error);
  else
    place.replaceChildren(
      note("bad", error.message, ...(error.errors ?? []).slice(1).map((e) => `${e.field}: found ${e.found}, allowed ${e.allowed}`)),
    );
  if (!("status" in error)) console.error(error);
}

/** Run something once at a time from a button, which waits meanwhile. */
export function busy(button, work) {
  return async (event) => {
    event?.preventDefault?.();
    if (button.disabled) return;
    button.disabled = true;
    button.setAttribute("aria-busy", "true");
    try {
      await work(event);
    } finally {
      button.disabled = false;
      button.removeAttribute("aria-busy");
    }
  };
}

/** Ask before something is lost; `words` is a text or an element. */
export function confirmed(question, words, yes, no = "Keep it") {
  return new Promise((resolve) => {
    const box = h(
      "dialog",
      { "aria-label": question },
      h(
        "form",
        { method: "dialog" },
        h("h2", null, question),
        typeof words === "string" ? h("p", null, words) : words,
        h(
          "div",
          { class: "row-of-buttons" },
          h("button", { value: "yes", class: "danger" }, yes),
          h("button", { value: "no", autofocus: true }, no),
        ),
      ),
    );
    box.addEventListener("close", () => {
      box.remove();
      resolve(box.returnValue === "yes");
    });
    document.body.append(box);
    box.showModal();
  });
}
