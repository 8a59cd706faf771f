// The contact between tool and holder.
import { card, h } from "../dom.js";
import { quantity } from "../forms.js";

const CONTACT = [
  ["translational_stiffness", "Translational stiffness", "N/m per m"],
  ["rotational_stiffness", "Rotational stiffness", "N m/rad per m"],
  ["translational_damping", "Translational damping", "N s/m per m"],
  ["rotational_damping", "Rotational damping", "N m s/rad per m"],
];

/** The card for a tooling's keys, `take(values)`, which fills it, and `write(found)`, which puts what is there into the keys to send. */
export function contactCard(keys) {
  const contact = CONTACT.map(([key, label, unit]) => [
    key,
    quantity(label, "none", keys.contact?.[key] ?? null, { name: `contact.${key}`, hint: unit }),
  ]);
  return {
    box: card(
      "Contact between tool and holder",
      null,
      h(
        "div",
        { class: "fields" },
        contact.map(([, box]) => box),
      ),
      h("p", { class: "small soft" }, "Per metre of insertion. All four empty: rigid."),
    ),
    take(values) {
      for (const [key, box] of contact) box.input.base = values[key];
    },
    write(found) {
      delete found.contact;
      if (contact.some(([, box]) => box.input.base !== null))
        found.contact = Object.fromEntries(contact.map(([key, box]) => [key, box.input.base]));
    },
  };
}
