// What a drawing does not tell of a tooling: how well it is known, and which others share what is not.
import { card, h } from "../dom.js";
import { declaredField, field, select } from "../forms.js";
import { factor, kindOf, plain } from "../units.js";

/**
 * The card for the declared spreads and the keys of a tooling, `take(spread)`, and `write(found)`, which puts what is chosen into the keys to send.
 *
 * A new tooling is roughly right: that it was measured is for somebody to say. Of one that is kept nothing is said that its file does not.
 */
export function doubtCard(declared, keys, fresh) {
  const models = [
    ["tool", "Model of the tool", "As EM12-4: the same wherever it is clamped"],
    ["holder", "Model of the holder", "As PG25: holders of one model share their contact"],
  ].map(([part, label, hint]) => {
    const input = h("input", { autocomplete: "off", maxlength: 200 });
    input.value = keys[part].model ?? "";
    return [part, input, field(label, input, { name: `${part}.model`, hint })];
  });
  const silent = !keys.spread && !fresh;
  const measured = keys.spread && declared.every(({ key }) => keys.spread[key] === 0);
  const known = select(
    [
      ...(silent ? [["silent", "Not stated (exact)"]] : []),
      ["rough", "Roughly right"],
      ["exact", "Exactly right: measured"],
    ],
    silent ? "silent" : measured ? "exact" : "rough",
  );
  const spreads = declared.map((each) => {
    const placeholder = plain(each.default * factor(kindOf(each.unit)), 4);
    return [each.key, declaredField(each, "spread", measured ? null : keys.spread?.[each.key], { placeholder })];
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
      if (known.value === "exact") found.spread = Object.fromEntries(declared.map(({ key }) => [key, 0]));
      if (known.value === "rough")
        found.spread = Object.fromEntries(spreads.filter(([, box]) => box.input.base !== null).map(([key, box]) => [key, box.input.base]));
    },
  };
}
