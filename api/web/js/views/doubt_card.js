// What a drawing does not tell of a tooling: how well it is known, and which others share what is not.
import { card, h } from "../dom.js";
import { field, quantity, select } from "../forms.js";
import { factor, plain } from "../units.js";

// key, label, kind, and what stands for an empty field: what an honest drawing is good for
const SPREADS = [
  ["stickout_mm", "± Stickout", "length", 0.05, "A presetter's; 0.3 mm with a ruler"],
  ["fluted_diameter_percent", "± Fluted diameter", "percent", 3, "Of an equivalent cylinder"],
  ["youngs_modulus_percent", "± Young's modulus", "percent", 2, "Of the tool"],
  ["contact_stiffness_percent", "± Contact stiffness", "percent", 40, "70 % where the contact is the catalogue's"],
  ["contact_damping_percent", "± Contact damping", "percent", 100],
  ["holder_diameter_percent", "± Holder diameters", "percent", 0.5],
  ["segment_length_mm", "± Segment lengths", "length", 0.05],
  ["corner_radius_mm", "± Corner radius", "length", 0.1],
  ["reclamping_percent", "± Reclamping", "percent", 10, "Contact, from clamping to clamping"],
  ["spindle_joint_percent", "± Flange joint", "percent", 5, "From clamping to clamping"],
];

/**
 * The card for the keys of a tooling, `take(spread)`, and `write(found)`, which puts what is chosen into the keys to send.
 *
 * A new tooling is roughly right: that it was measured is for somebody to say. Of one that is kept nothing is said that its file does not.
 */
export function doubtCard(keys, fresh) {
  const models = [
    ["tool", "Model of the tool", "As EM12-4: the same wherever it is clamped"],
    ["holder", "Model of the holder", "As PG25: holders of one model share their contact"],
  ].map(([part, label, hint]) => {
    const input = h("input", { autocomplete: "off", maxlength: 200 });
    input.value = keys[part].model ?? "";
    return [part, input, field(label, input, { name: `${part}.model`, hint })];
  });
  const silent = !keys.spread && !fresh;
  const measured = keys.spread && SPREADS.every(([key]) => keys.spread[key] === 0);
  const known = select(
    [
      ...(silent ? [["silent", "Not stated (exact)"]] : []),
      ["rough", "Roughly right"],
      ["exact", "Exactly right: measured"],
    ],
    silent ? "silent" : measured ? "exact" : "rough",
  );
  const spreads = SPREADS.map(([key, label, kind, usual, hint = ""]) => {
    const props = { placeholder: plain(usual * factor(kind), 4) };
    return [key, quantity(label, kind, measured ? null : (keys.spread?.[key] ?? null), { name: `spread.${key}`, hint, props })];
  });
  const rough = h(
    "div",
    { class: "view" },
    h(
      "div",
      { class: "fields" },
      models.map(([, , box]) => box),
      spreads.map(([, box]) => box),
    ),
    h(
      "p",
      { class: "small soft" },
      "Standard deviations of what the drawing says. Empty: as well as drawings usually are; 0: exactly. Cuts teach what is not known, and ",
      "what stays open widens the bands.",
    ),
  );
  const show = () => (rough.hidden = known.value !== "rough");
  known.addEventListener("input", show);
  show();
  return {
    box: card("How well the drawing is known", null, h("div", { class: "fields" }, field("The drawing is", known, { name: "spread" })), rough),
    /** As the catalogue knows what was taken from it. */
    take(spread) {
      known.value = "rough";
      for (const [key, box] of spreads) if (key in spread) box.input.base = spread[key];
      show();
    },
    write(found) {
      delete found.spread;
      for (const [part, input] of models) {
        delete found[part].model;
        if (input.value.trim()) found[part].model = input.value.trim();
      }
      if (known.value === "exact") found.spread = Object.fromEntries(SPREADS.map(([key]) => [key, 0]));
      if (known.value === "rough")
        found.spread = Object.fromEntries(spreads.filter(([, box]) => box.input.base !== null).map(([key, box]) => [key, box.input.base]));
    },
  };
}
