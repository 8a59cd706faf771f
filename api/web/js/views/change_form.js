// The form of a tool change: toolings, cut, speeds, and what is asked more rarely; an address fills it.
import { h, fill } from "../dom.js";
import { field, select } from "../forms.js";
import { asAddress, fromAddress } from "../tested.js";
import { plain, q, quantityListInput, text, unit } from "../units.js";
import { bodyOf, checked, DIRECTIONS, NUMBERS, numberFields, numbersAsAddress, QUICK, runoutOf, STRATEGIES } from "./change_question.js";

const MOST = 12;
/** The tooling that was written last is what somebody is working on. */
const newest = (toolings) => toolings.reduce((last, each) => (each.changed >= last.changed ? each : last));
/** What is folded away until an address says something of it. */
const FURTHER = ["method", "material", "deep", "ktc", "krc", "kac", "runout", "land", "dent", "mu", "power", "torque", "temp"];

/**
 * The form: `element`, `button`, `state()` for the address, `body()` for the service, `problem()`, `slow()`, `tested`, `tell()`.
 * `onchange(now)` is called when something else is asked.
 *
 * The subject is what is asked about: `element` to choose it by, `names()` of toolings, `faults()`, `body()` and `address()` of what they
 * stand on, `material` in words where that says which is cut, `shaped` where a cutter may be no cylinder, `temperatures` of its cuts [°C]
 * where it changes with these.
 */
export function changeForm({ subject, materials, kinds, query, onchange }) {
  const fields = numberFields(NUMBERS, query);
  const runout = quantityListInput("displacement", runoutOf(query), { placeholder: "0 8 0 8" });
  fields.runout = field("Run-out, tooth by tooth", runout, { name: "cut.runout_um", unit: "displacement" });
  fields.runout.input = runout;
  const strategy = select(STRATEGIES, query.get("st"));
  const stock = select([["", "As where it cut before"], ["block", "A block"]], query.get("stock"));
  // along a wall a block is but another radial immersion
  const shaped = subject.shaped || stock.value !== "";
  const direction = select(DIRECTIONS, query.get("fd"));
  const method = select(kinds, query.get("method"));
  const matters = [["", subject.material ?? "Choose one, or write coefficients"], ...materials.map((each) => [each.name, each.name])];
  const material = select(matters, query.get("material"));
  const button = h("button", { class: "primary" }, "Compute");
  const form = { tested: { name: query.get("cutfile") ?? "", cuts: fromAddress(query.get("cuts") ?? "") }, button };
  const slow = () => method.value !== QUICK;

  // what stands behind a material of the library
  const source = h("p", { class: "small soft below" });
  const follow = () => {
    const found = materials.find((each) => each.name === material.value);
    const words = found && [
      q("pressure", found.ktc_mpa),
      `, radial ${plain(found.krc, 3)}, ±\u202f${plain(found.ktc_spread_percent)} %: ${found.condition} (${found.source})`,
    ];
    fill(source, words ?? null);
    source.hidden = !words;
    button.hidden = !slow();
  };

  const stockField = field("Stock beside the path", stock, { name: "cut.stock" });
  stockField.hidden = !shaped;
  const strategyField = field("Strategy", strategy, { name: "cut.strategy" });
  const followStock = () => {
    const block = stock.value === "block";
    for (const each of [fields.ya, fields.yb]) each.hidden = !block;
    for (const each of [fields.im, strategyField]) each.hidden = block;
  };
  followStock();

  // on a phone the answer stands higher than the conditions, which are told in a line
  const inShort = h("span", { class: "soft" });
  const conditions = h(
    "details",
    { class: "conditions", open: matchMedia("(min-width: 1100px)").matches },
    h("summary", null, h("strong", null, "Cut and speeds"), inShort),
    h(
      "fieldset",
      null,
      h("legend", { class: "unseen" }, "Cut"),
      h(
        "div",
        { class: "fields" },
        stockField,
        fields.im,
        strategyField,
        fields.ya,
        fields.yb,
        fields.fz,
        field("Feed direction", direction, { name: "cut.feed_direction" }),
      ),
    ),
    h("fieldset", null, h("legend", { class: "unseen" }, "Speeds"), h("div", { class: "fields" }, fields.from, fields.to, fields.step)),
  );
  const { ktc, krc, kac, power, torque, deep, land, dent, mu, temp } = fields;
  if (subject.temperatures) temp.input.placeholder = `${text("temperature", subject.temperatures[1])}: warm`;
  const element = h(
    "form",
    { class: "card change-form", novalidate: true },
    subject.element,
    conditions,
    h(
      "details",
      { open: subject.material === null || FURTHER.some((key) => query.has(key) && query.get(key) !== QUICK) },
      h("summary", null, "Material, spindle, method"),
      field("Material", material, { name: "cut.material" }),
      source,
      field("Method", method, { name: "method" }),
      h("div", { class: "fields" }, ktc, krc, shaped ? kac : null, power, torque, deep, subject.temperatures ? temp : null, fields.runout, land, dent, mu),
      h(
        "p",
        { class: "small soft" },
        "Empty coefficients are those of the material. Wear land, indentation and friction: process damping, which zero order leaves out, ",
        "as it does run-out.",
      ),
    ),
    button,
  );
  element.addEventListener("input", (event) => {
    if (event.target.closest(".picks, .picks-box")) return;
    follow();
    followStock();
    onchange(false);
  });
  follow();

  const choice = () => ({ stock: stock.value, strategy: strategy.value, direction: direction.value, method: method.value, material: material.value });
  const state = () => ({
    ...subject.address(),
    tooling: subject.names(),
    stock: stock.value,
    st: strategy.value,
    fd: direction.value,
    method: method.value,
    material: material.value,
    ...numbersAsAddress(NUMBERS, fields),
    runout: runout.base?.join(" "),
    cuts: asAddress(form.tested.cuts),
    cutfile: form.tested.cuts.length ? form.tested.name : null,
  });
  /** Say in a line what is asked. */
  const tell = () => {
    const shown = (key, kind) => `${fields[key].input.value}\u00a0${unit(kind)}`;
    const speeds = `${fields.from.input.value} to ${shown("to", "speed")}`;
    const block = () => `a block from ${fields.ya.input.value} to ${shown("yb", "length")}`;
    const beside = () => `${strategy.selectedOptions[0].textContent}, ${shown("im", "percent")} immersion`;
    fill(inShort, `${stock.value === "block" ? block() : beside()}, ${shown("fz", "feed")} per tooth, ${speeds}`);
  };
  // of what nothing was cut on nobody knows the material
  const cutless = () => subject.material === null && !material.value && fields.ktc.input.base === null;
  const unknown = { field: "cut.material", found: "nothing", allowed: "A material, or its coefficients" };
  const problem = () => checked(fields, [...subject.faults(), ...(cutless() ? [unknown] : [])], stock.value);
  const body = () => bodyOf(subject.body(), subject.names(), fields, { ...choice(), tested: form.tested.cuts });
  return Object.assign(form, { element, state, tell, slow, body, problem });
}

/** The choice of one or more toolings of the library: `element`, `names()`, `faults()`. */
export function toolingPicks(toolings, query, onchange) {
  const named = query.getAll("tooling").filter((name) => toolings.some((tooling) => tooling.name === name));
  const chosen = new Set(named.length ? named.slice(0, MOST) : [newest(toolings).name]);
  const element = h(
    "fieldset",
    { "data-field": "toolings" },
    h("legend", null, "Toolings"),
    picks(toolings, chosen, onchange),
    h("div", { class: "fault", id: "toolings-fault", hidden: true }),
  );
  const faults = () => (chosen.size ? [] : [{ field: "toolings", found: "nothing", allowed: "One tooling at least" }]);
  return { element, names: () => [...chosen], faults };
}

function picks(toolings, chosen, onchange) {
  const boxes = toolings.map((tooling) => {
    const box = h("input", {
      type: "checkbox",
      checked: chosen.has(tooling.name),
      onchange: () => {
        if (box.checked) chosen.add(tooling.name);
        else chosen.delete(tooling.name);
        limit();
        onchange();
      },
    });
    const words = h(
      "span",
      null,
      h("strong", null, tooling.name),
      " ",
      h(
        "span",
        { class: "soft small" },
        `${tooling.teeth} × Ø${text("length", tooling.diameter_mm, { digits: 0 })}, ${text("length", tooling.stickout_mm, { digits: 1 })} out`,
      ),
    );
    return { box, item: h("li", { dataset: { name: tooling.name.toLowerCase() } }, h("label", { class: "check" }, box, words)) };
  });
  function limit() {
    for (const { box } of boxes) box.disabled = !box.checked && chosen.size >= MOST;
  }
  limit();
  const list = h(
    "ul",
    { class: "picks" },
    boxes.map((b) => b.item),
  );
  if (toolings.length <= 8) return list;
  const search = h("input", {
    type: "search",
    placeholder: "Search …",
    "aria-label": "Search toolings",
    oninput: () => {
      const wanted = search.value.trim().toLowerCase();
      for (const { item, box } of boxes) item.hidden = !box.checked && !item.dataset.name.includes(wanted);
    },
  });
  return h("div", { class: "picks-box" }, search, list);
}
