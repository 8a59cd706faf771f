// The key, where the service asks for one: kept until the window is closed, never longer.
import { hasKey, setKey } from "../api.js";
import { h } from "../dom.js";
import { field } from "../forms.js";

let open = null;

/** Ask for a key; whoever was refused asks again with it. */
export function askForKey() {
  if (open) return;
  const wrong = hasKey();
  const input = h("input", { type: "password", autocomplete: "off", spellcheck: "false", autofocus: true });
  const box = field("Key", input, { hint: "It begins with ri_. It is kept until this window is closed." });
  if (wrong) {
    const fault = box.querySelector(".fault");
    fault.hidden = false;
    fault.append("The service does not take the key that was given.");
    input.setAttribute("aria-invalid", "true");
  }
  open = h(
    "dialog",
    { "aria-labelledby": "key-title" },
    h(
      "form",
      { method: "dialog" },
      h("h2", { id: "key-title" }, "This service asks for a key"),
      h("p", { class: "soft" }, "Whoever runs it makes one with ", h("code", null, "rcsa-ident-serve create-key"), "."),
      box,
      h(
        "div",
        { class: "row-of-buttons" },
        h("button", { class: "primary", value: "use" }, "Use this key"),
        h("button", { value: "no", formnovalidate: true }, "Cancel"),
      ),
    ),
  );
  open.addEventListener("close", () => {
    const used = open.returnValue === "use";
    open.remove();
    open = null;
    if (!used) return;
    setKey(input.value);
    window.dispatchEvent(new Event("key-changed"));
  });
  document.body.append(open);
  open.showModal();
}

/** Forget the key; nothing where there is none. */
export function keyButton() {
  if (!hasKey()) return null;
  return h(
    "button",
    {
      type: "button",
      class: "quiet small",
      onclick: () => {
        setKey("");
        window.dispatchEvent(new Event("key-changed"));
      },
    },
    "Forget the key",
  );
}
