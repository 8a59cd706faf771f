// What is asked of a path: on which machine or arm, with which tooling, out of which stock, and how the answer is found.
import { fill, h, note } from "../dom.js";
import { field, quantity, select } from "../forms.js";
import { plain, q, quantityListInput } from "../units.js";

/** What may be asked, in words, and what it takes: a machine, a method. */
export const QUESTIONS = [
  ["stability", "How far each move is from chatter"],
  ["milling", "Turn by turn, in time"],
  ["removal", "What is taken out, no machine"],
];
const METHODS = ["full-discretisation", "zero-order", "semi-discretisation", "multi-frequency"];
const CORNERS = [
  ["low", "Lower corner: x y z"],
  ["high", "Upper corner: x y z"],
];
/** A block below the path, where nobody has told one: deeper than the lowest place by this [mm]. */
const BELOW = 5;

/** The form: `element`, `button`, `kind`, `query()` for the service, `state()` for the address, `path(file, told)`, `stock(file)`. */
export function pathForm({ machines, robots, postures, toolings, materials, query }) {
  const carriers = [
    ...machines.map((each) => [`machine ${each.id}`, each.name]),
    ...robots.map((each) => [`robot ${each.name}`, `${each.words}, a robot`]),
  ];
  const asked = select(QUESTIONS, query.get("ask"));
  const on = select(carriers, query.get("on") ?? `machine ${query.get("machine")}`);
  const posture = h("input", { type: "text", autocomplete: "off", value: query.get("q") ?? "" });
  const tooling = select(toolings.map((each) => [each.name, each.name]), query.get("tooling"));
  const matters = [["", "As in the identification"], ...materials.map((each) => [each.name, each.name])];
  const material = select(matters, query.get("material"));
  const method = select(METHODS.map((each) => [each, each]), query.get("method"));
  const bands = h("input", { type: "checkbox", checked: query.get("bands") === "yes" });
  const speed = quantity("Spindle speed", "speed", numberOf(query.get("n")), { name: "spindle_speed_rpm", hint: "Where the path has none" });
  const cell = quantity("Between lines of material", "length", numberOf(query.get("cell")), { name: "cell_mm", hint: "Empty: a twentieth of the tool's radius" });
  const step = quantity("Between places", "length", numberOf(query.get("step")), { name: "step_mm", hint: "Empty: a tenth of the tool's radius" });
  const corners = Object.fromEntries(
    CORNERS.map(([key]) => [key, quantityListInput("length", (query.get(key) ?? "").split(" ").filter(Boolean).map(Number))]),
  );
  const drawn = h("p", { class: "small", hidden: true });
  const away = h("button", { type: "button", class: "quiet small", onclick: () => form.stock(null) }, "Take it away");
  const about = h("div", { class: "view" });
  const button = h("button", { class: "primary", disabled: true }, "Cut along the path");
  const carrier = field("Machine or robot", on, { name: "machine" });
  const postureField = field("Posture near the first place, degrees", posture, { name: "robot.posture_deg" });
  const block = h(
    "div",
    { class: "fields broad", "data-field": "block_mm" },
    CORNERS.map(([key, words]) => field(words, corners[key], { unit: "length" })),
    h("div", { class: "fault", hidden: true }),
  );
  const materialField = field("Material", material, { name: "material" });
  const methodField = field("Method", method, { name: "method" });
  const bandsField = h("label", { class: "check" }, bands, "With what is left open of the machine: takes long");
  const element = h(
    "form",
    { class: "card path-form", novalidate: true },
    field("What is asked", asked, { name: "ask" }),
    carrier,
    postureField,
    field("Tooling", tooling, { name: "tooling" }),
    materialField,
    speed,
    h("fieldset", { "data-field": "path" }, h("legend", null, "Path"), about, h("div", { class: "fault", hidden: true })),
    h(
      "fieldset",
      { "data-field": "stock" },
      h("legend", null, "Stock"),
      block,
      h("div", null, drawn, away),
      h("div", { class: "fault", hidden: true }),
    ),
    h("details", null, h("summary", null, "How fine, and by which method"), methodField, bandsField, h("div", { class: "fields broad" }, cell, step)),
    button,
  );
  const follow = () => {
    const robot = on.value.startsWith("robot ");
    const alone = asked.value === "removal";
    for (const each of [carrier, materialField, speed]) each.hidden = alone;
    postureField.hidden = alone || !robot;
    for (const each of [methodField, bandsField]) each.hidden = asked.value !== "stability";
    step.hidden = asked.value === "milling";
    if (robot && !posture.value.trim()) posture.value = (postures[on.value.slice(6)] ?? []).join(" ");
  };
  for (const each of [asked, on]) each.addEventListener("change", () => (each === on && (posture.value = ""), follow()));

  let surface = null;
  const form = {
    element,
    button,
    get kind() {
      return asked.value;
    },
    get surface() {
      return surface;
    },
    path: (file, told) => {
      button.disabled = false;
      fill(about, pathTold(file.name, told));
      speed.querySelector(".hint").textContent = told.spindle_speed_told ? "The path has its own" : "Needed: the path has none on some moves";
      if (!surface && !corners.low.value && !corners.high.value) {
        // a first guess, to be corrected
        corners.low.base = told.low_mm.map((v, k) => Math.floor(v) - (k === 2 ? BELOW : 0));
        corners.high.base = told.high_mm.map((v, k) => Math.max(Math.ceil(v), Math.floor(told.low_mm[k]) + 1));
      }
    },
    stock: (file) => {
      surface = file;
      block.hidden = Boolean(file);
      drawn.hidden = away.hidden = !file;
      fill(drawn, file ? `Its surface is in ${file.name}.` : null);
    },
    query: () => {
      const alone = asked.value === "removal";
      const found = { tooling: tooling.value, cell_mm: cell.input.base };
      if (!surface) found.block_mm = [...(corners.low.base ?? []), ...(corners.high.base ?? [])];
      if (asked.value !== "milling") found.step_mm = step.input.base;
      if (alone) return found;
      const [kind, name] = [on.value.slice(0, on.value.indexOf(" ")), on.value.slice(on.value.indexOf(" ") + 1)];
      if (kind === "machine") found.machine = name;
      else found.robot = { robot: name, posture_deg: posture.value.split(/[\s;]+/).filter(Boolean).map((v) => Number(v.replace(",", "."))) };
      found.spindle_speed_rpm = speed.input.base;
      if (material.value) found.cut = { material: material.value };
      if (asked.value === "stability") Object.assign(found, { method: method.value, bands: bands.checked });
      return found;
    },
    state: () => ({
      ask: asked.value,
      on: on.value,
      q: on.value.startsWith("robot ") ? posture.value : null,
      tooling: tooling.value,
      material: material.value,
      method: method.value === METHODS[0] ? null : method.value,
      bands: bands.checked ? "yes" : null,
      n: speed.input.base,
      cell: cell.input.base,
      step: step.input.base,
      low: corners.low.base?.join(" "),
      high: corners.high.base?.join(" "),
    }),
  };
  fill(about, h("p", { class: "soft" }, "None yet: drop PATH.nc or PATH.csv."));
  form.stock(null);
  follow();
  return form;
}

const numberOf = (text) => (text === null || text === "" ? null : Number(text));

function pathTold(name, told) {
  const time = told.time_s === null ? null : h("span", { class: "nowrap" }, `${plain(told.time_s, told.time_s < 60 ? 1 : 0)} s at its feeds`);
  return [
    h("p", null, h("strong", null, name), `: ${plain(told.places)} places, `, q("length", told.length_mm, { digits: 0 }), ", ", q("length", told.cutting_length_mm, { digits: 0 }), " at a feed", time ? [", ", time] : null, "."),
    told.warnings.length ? note("doubt", ...told.warnings.map((each) => `${each.charAt(0).toUpperCase()}${each.slice(1)}.`)) : null,
  ];
}
