// What is asked of an arm: which one, the angles of its joints, the tooling, and the cut.
import { fill, h } from "../dom.js";
import { field, select } from "../forms.js";
import { plain, unit } from "../units.js";
import { numberFields, NUMBERS as ASKED, numbersAsAddress, STRATEGIES } from "./change_question.js";

/** The published arms, and a posture at which each would mill [°]. */
export const PUBLISHED = {
  tx200: [-11.71, 20.78, 110, 82.76, 60.8, -166.96],
  kr210: [20, 10, 30, 0, 30, 0],
  kr500: [-71.73, -68.62, 110.51, 35.54, -47.68, -204.68],
};
/** What is asked of its cut; its speeds lie wider apart. */
const NUMBERS = ASKED.filter(([key]) => ["im", "from", "to", "step", "deep"].includes(key)).map(([key, kind, usual, ...rest]) => [
  key,
  kind,
  key === "step" ? 100 : usual,
  ...rest,
]);
/** Of a joint that turns without end. */
const ENDLESS = [-360, 360];
const within = (value, [low, high]) => Math.min(high, Math.max(low, value));

/**
 * The sliders of the joints: `element`, `build(joints, angles)`, `set(angles)`, `angles`.
 * `onmove(k)` is told which joint moved, `onchosen(k)` which one is looked at, null for none.
 */
export function jointSliders(onmove, onchosen) {
  const element = h("fieldset", null);
  const sliders = { element, angles: [] };
  let rows = [];

  sliders.build = (joints, angles) => {
    sliders.angles = joints.map((joint, k) => within(angles[k] ?? 0, joint.limits_deg ?? ENDLESS));
    rows = joints.map((joint, k) => {
      const limits = joint.limits_deg ?? ENDLESS;
      const told = `${plain(limits[0], 1)}° to ${plain(limits[1], 1)}°`;
      const id = `joint-${k}`;
      const shared = { onfocus: () => onchosen(k), onblur: () => onchosen(null) };
      const slide = h("input", { type: "range", id, min: limits[0], max: limits[1], step: "any", title: told, ...shared });
      const exact = h("input", { type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${joint.name}, degrees`, ...shared });
      const fault = h("div", { class: "fault", id: `${id}-fault`, hidden: true });
      exact.setAttribute("aria-describedby", fault.id);
      const show = (value, typed = false) => {
        slide.value = value;
        slide.setAttribute("aria-valuetext", `${plain(value, 1)} degrees`);
        if (!typed) exact.value = String(Math.round(value * 100) / 100);
        fault.hidden = true;
        exact.removeAttribute("aria-invalid");
      };
      const take = (value, typed) => {
        sliders.angles[k] = value;
        show(value, typed);
        onmove(k);
      };
      slide.addEventListener("input", () => take(Math.round(Number(slide.value) * 10) / 10, false));
      // arrow keys move by a degree, with shift by a tenth
      slide.addEventListener("keydown", (event) => {
        const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
        if (!way) return;
        event.preventDefault();
        take(within(Math.round((sliders.angles[k] + way * (event.shiftKey ? 0.1 : 1)) * 100) / 100, limits), false);
      });
      exact.addEventListener("input", () => {
        const value = Number(exact.value.trim().replace("−", "-").replace(",", "."));
        if (exact.value.trim() !== "" && value >= limits[0] && value <= limits[1]) return take(value, true);
        fault.hidden = false;
        fill(fault, `From ${told}.`);
        exact.setAttribute("aria-invalid", "true");
      });
      const row = h(
        "div",
        { class: "joint" },
        h("label", { for: id }, joint.name),
        slide,
        h("div", { class: "with-unit" }, exact, h("span", { class: "unit" }, "°")),
        fault,
      );
      show(sliders.angles[k]);
      return { row, show };
    });
    fill(element, h("legend", null, "Posture"), h("div", { class: "joints" }, rows.map((each) => each.row)));
  };
  /** Take angles that lie within the limits, with whole turns where that brings them there. */
  sliders.set = (angles) => {
    sliders.angles = [...angles];
    rows.forEach((each, k) => each.show(sliders.angles[k]));
  };
  return sliders;
}

/** The form: `element`, `body(robot)` for lobes, `state()` for the address, `robot`, `tooling`. */
export function robotForm({ robots, toolings, materials, query, sliders, onrobot, onask, onforget }) {
  const robot = select(robots.map((each) => [each.name, each.words]), query.get("robot"));
  const tools = [["", "None"], ...toolings.map((each) => [each.name, each.name])];
  const tooling = select(tools, query.get("tooling") ?? toolings[0]?.name);
  const material = select(materials.map((each) => [each.name, each.name]), query.get("material"));
  const strategy = select(STRATEGIES, query.get("st"));
  const only = h("input", { type: "checkbox", checked: query.get("only") === "yes" });
  const fields = numberFields(NUMBERS, query);
  const forget = h("button", { type: "button", class: "quiet danger small", onclick: () => onforget(robot.value) }, "Forget it");
  const follow = () => (forget.hidden = robots.find((each) => each.name === robot.value).published === true);
  robot.addEventListener("change", () => {
    follow();
    onrobot();
  });
  follow();
  const { im, from, to, step, deep } = fields;
  const element = h(
    "form",
    { class: "card robot-form", novalidate: true, onsubmit: (event) => event.preventDefault() },
    h("div", null, field("Arm", robot, { name: "robot" }), forget),
    sliders.element,
    h("label", { class: "check" }, only, "Drives alone give way"),
    field("Tooling", tooling, { name: "toolings" }),
    h(
      "details",
      { class: "conditions", open: matchMedia("(min-width: 1100px)").matches },
      h("summary", null, h("strong", null, "Cut and speeds")),
      field("Material", material, { name: "cut.material" }),
      h("div", { class: "fields" }, im, field("Strategy", strategy, { name: "cut.strategy" }), from, to, step, deep),
    ),
  );
  for (const each of [only, tooling, material, strategy]) each.addEventListener("change", () => onask(each === tooling));
  for (const each of Object.values(fields)) each.input.addEventListener("input", () => onask(false));
  const value = (key) => fields[key].input.base;
  return {
    element,
    get robot() {
      return robot.value;
    },
    get tooling() {
      return tooling.value;
    },
    posed: () => ({ robot: robot.value, posture_deg: sliders.angles, joints_only: only.checked }),
    cut: () => ({
      cut: { immersion: value("im") / 100, strategy: strategy.value, material: material.value },
      speeds: { from_rpm: value("from"), to_rpm: value("to"), step_rpm: value("step") },
      max_depth_mm: value("deep"),
    }),
    /** What can be seen to be wrong before anything is sent, as the service would say it. */
    faults: () =>
      NUMBERS.filter(([key]) => !Number.isFinite(value(key)) || value(key) === null).map(([key, kind, , name]) => ({
        field: name,
        found: fields[key].input.value || "nothing",
        allowed: `A number is needed here [${unit(kind)}]`,
      })),
    state: () => ({
      robot: robot.value,
      q: sliders.angles.map((each) => Math.round(each * 100) / 100).join(" "),
      only: only.checked ? "yes" : null,
      tooling: tooling.value,
      material: material.value,
      st: strategy.value === "down" ? null : strategy.value,
      ...numbersAsAddress(NUMBERS, fields),
    }),
  };
}
