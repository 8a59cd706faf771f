// The contact between tool and holder.
import { card, h } from "../dom.js";
import { declaredField } from "../forms.js";

/** The card for the declared keys of a contact and those of a tooling, `take(values)`, which fills it, and `write(found)`, which puts what is there into the keys to send. */
export function contactCard(declared, keys) {
  const contact = declared.map((each) => [each.key, declaredField(each, "contact", keys.contact?.[each.key])]);
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
