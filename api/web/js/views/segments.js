// A table of segments that one writes into; rows are added, moved and taken away with keys or pointer.
import { h, labelled } from "../dom.js";
import { quantityInput, u } from "../units.js";

const MATERIALS = ["carbide", "steel", "aluminium"];

/** The table of declared keys, `rows()`: the segments as the service wants them, `replace()` and `lengthen()`. */
export function segmentsTable(declared, caption, name, segments, onchange) {
  const columns = declared.filter(({ label }) => label);
  const body = h("tbody", { role: "rowgroup" });
  const known = [...new Set([...MATERIALS, ...segments.map((s) => s.material)])];
  for (const segment of segments) body.append(row(segment));
  number();

  function cell(tr, { key, label, hint, default: usual }, segment) {
    const input = quantityInput("length", segment[key] === usual ? null : (segment[key] ?? null), {
      "aria-label": label,
      placeholder: hint,
    });
    tr.inputs[key] = input;
    return labelled(h("td", { "data-field": "", role: "cell" }, input, h("div", { class: "fault", hidden: true })), label, u("length"));
  }

  function row(segment) {
    const tr = h("tr", { role: "row" });
    tr.segment = segment;
    tr.inputs = {};
    const material = h(
      "select",
      { "aria-label": "Material" },
      known.map((m) => h("option", { value: m, selected: m === segment.material }, m)),
    );
    tr.inputs.material = material;
    tr.append(
      h("th", { scope: "row", role: "rowheader" }),
      ...columns.map((each) => cell(tr, each, segment)),
      labelled(h("td", { "data-field": "", role: "cell" }, material, h("div", { class: "fault", hidden: true })), "Material"),
      h(
        "td",
        { class: "nowrap", role: "cell" },
        act("↑", "Move up", () => tr.previousElementSibling?.before(tr), tr),
        act("↓", "Move down", () => tr.nextElementSibling?.after(tr), tr),
        act(
          "+",
          "Add one below",
          () => {
            const next = row(values(tr));
            tr.after(next);
            next.querySelector("input").focus();
          },
          tr,
        ),
        act(
          "✕",
          "Take away",
          () => {
            if (body.children.length > 1) tr.remove();
          },
          tr,
        ),
      ),
    );
    return tr;
  }

  function act(sign, words, work, tr) {
    return h(
      "button",
      {
        type: "button",
        class: "quiet",
        "aria-label": words,
        title: words,
        onclick: (event) => {
          work();
          number();
          onchange();
          if (tr.isConnected && document.activeElement === document.body) event.currentTarget.focus();
          if (!tr.isConnected) body.querySelector("button").focus();
        },
      },
      sign,
    );
  }

  function number() {
    [...body.children].forEach((tr, i) => {
      tr.firstChild.replaceChildren(String(i + 1));
      Object.entries(tr.inputs).forEach(([key, input]) => {
        input.parentElement.dataset.field = `${name}.${i}.${key}`;
        input.nextElementSibling.id = `${name}.${i}.${key}-fault`.replaceAll(".", "-");
      });
    });
  }

  function values(tr) {
    const found = { ...tr.segment, material: tr.inputs.material.value };
    for (const { key, needed } of columns) {
      const { base } = tr.inputs[key];
      if (base === null && !needed) delete found[key];
      else found[key] = base;
    }
    return found;
  }

  const box = h(
    "div",
    { class: "scrolls", tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: "segments stacks", role: "table" },
      h("caption", null, caption),
      h(
        "thead",
        { role: "rowgroup" },
        h(
          "tr",
          { role: "row" },
          h("th", { scope: "col", role: "columnheader" }, "#"),
          columns.map(({ label }) => h("th", { scope: "col", role: "columnheader" }, label, h("span", { class: "unit" }, u("length")))),
          h("th", { scope: "col", role: "columnheader" }, "Material"),
          h("th", { scope: "col", role: "columnheader" }, h("span", { class: "unseen" }, "Change")),
        ),
      ),
      body,
    ),
  );
  /** Make the last segment longer by so many millimetres. */
  function lengthen(by) {
    body.lastElementChild.inputs.length_mm.base += by;
    onchange();
  }
  /** Show other segments in their place. */
  function replace(next) {
    body.replaceChildren(...next.map(row));
    number();
  }
  return { box, rows: () => [...body.children].map(values), lengthen, replace };
}
