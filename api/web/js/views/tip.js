// Lobes of a tip that was tapped: its FRFs dropped or averaged from hits, the cutter by its teeth or from the library.
import { all, get } from "../api.js";
import { add, card, h, head, link, table } from "../dom.js";
import { dropZone } from "../drop.js";
import { failed, field, quantity, select } from "../forms.js";
import { remember, to } from "../router.js";
import { addTapped, keepTapped, tapped } from "../tapped.js";
import { changeForm } from "./change_form.js";
import { methods } from "./change_question.js";
import { listenTabs } from "./listen.js";
import { lobesBench } from "./lobes_bench.js";

const WANTED = "The lobes appear here once cutter and material are told.";
const DIRECTIONS = [["", "as the file says"], ...["X", "Y", "Z", "XY", "YX"].map((axes) => [axes, axes])];
const UNITS = [["", "as the files say"], ...["m/N", "um/N", "mm/N", "in/lbf", "(m/s^2)/N", "g/N", "(m/s)/N"].map((unit) => [unit, unit.replace("um", "µm")])];
const CORRECTIONS = [
  ["", "what is certain"],
  ["none", "nothing"],
  ["reverse", "reversed sensor or hammer"],
  ["conjugate", "time as e^(-iωt)"],
  ["conjugate-reverse", "both of these"],
  ["exchange", "exchanged columns"],
  ["exchange-reverse", "exchanged and reversed"],
];
/** A cutter's own fields: key in the address, kind, key of a tooling file, label. */
const CUTTER = [
  ["teeth", "none", "teeth", "Teeth"],
  ["dia", "length", "diameter_mm", "Diameter"],
  ["helix", "degree", "helix_deg", "Helix"],
];

export async function view(_args, query, place) {
  const [toolings, { items: materials }, kinds] = await Promise.all([all("toolings"), get("materials"), methods()]);
  const fault = h("div");
  const zone = dropZone(
    "Drop FRFs of a tip",
    "Measured where the tool cuts: FRF.csv, a universal file in text, or columns of frequency, real and imaginary part, as CutPro and MetalMAX write them.",
    take,
    { small: tapped().length > 0, folder: false },
  );
  add(
    place,
    head("Lobes of a tip", "A measured tip has its stability lobes at once: no machine has to be identified.", listenTabs("tip")),
    zone,
    fault,
  );
  if (!tapped().length) {
    add(place, h("p", { class: "soft" }, "No FRF yet. ", link(to("tap"), "Hits of a hammer"), " become one here, too."));
    return;
  }
  const subject = cutterPicks(toolings, query);
  const form = changeForm({ subject, materials, kinds, query, onchange: (now) => bench.changed(now) });
  const bench = lobesBench({ form, toolings: subject.summaries, query, keep: (state) => remember("tip", state), wanted: WANTED });
  add(place, measured(() => bench.changed(true), fault), bench.element);
  bench.begin();
  return bench.end;

  async function take(files) {
    try {
      for (const file of files) addTapped({ name: file.name, text: await file.text(), axes: "" });
      window.dispatchEvent(new Event("refresh"));
    } catch (error) {
      failed(fault, error);
    }
  }
}

/** What was measured: each FRF with its direction, and a way to take it away. */
function measured(onchange, fault) {
  const changed = (frfs) => {
    try {
      keepTapped(frfs);
    } catch (error) {
      failed(fault, error);
    }
  };
  const axesOf = (frf) => {
    const choice = select(DIRECTIONS, frf.axes, { "aria-label": `Direction of ${frf.name}` });
    choice.addEventListener("change", () => {
      frf.axes = choice.value;
      changed(frfs);
      onchange();
    });
    return choice;
  };
  const correctionOf = (frf) => {
    const choice = select(CORRECTIONS, frf.correction ?? "", { "aria-label": `Correction of ${frf.name}` });
    choice.addEventListener("change", () => {
      frf.correction = choice.value;
      changed(frfs);
      onchange();
    });
    return choice;
  };
  const away = (frf) =>
    h(
      "button",
      {
        type: "button",
        class: "quiet small",
        "aria-label": `Remove ${frf.name}`,
        onclick: () => {
          changed(frfs.filter((each) => each !== frf));
          window.dispatchEvent(new Event("refresh"));
        },
      },
      "Remove",
    );
  const frfs = tapped();
  const columns = [
    { name: "FRF", cell: (frf) => frf.name },
    { name: "Direction", cell: axesOf },
    { name: "Put right", cell: correctionOf },
    { name: "Remove", cell: away },
  ];
  return card("Measured", null, table("FRFs of the tip", columns, frfs), h("p", { class: "small soft" }, "A direction without an FRF is rigid. XY is the motion along X under a force along Y."));
}

/** What was tapped: a cutter by its teeth, or a tooling of the library. */
function cutterPicks(toolings, query) {
  const asked = query.get("tooling") ?? "";
  const which = select([["", "A cutter, by its teeth"], ...toolings.map((each) => [each.name, each.name])], asked);
  const own = Object.fromEntries(
    CUTTER.map(([key, kind, name, label]) => [key, quantity(label, kind, query.get(key) ? Number(query.get(key)) : null, { name: `cutter.${name}` })]),
  );
  const lowest = quantity("Lowest line", "hertz", query.get("low") ? Number(query.get("low")) : null, {
    name: "tip.from_hz",
    hint: "Accelerometers drift below",
  });
  const units = select(UNITS, query.get("units") ?? "");
  const follow = () => Object.values(own).forEach((each) => (each.hidden = which.value !== ""));
  which.addEventListener("change", follow);
  follow();
  const element = h(
    "fieldset",
    null,
    h("legend", null, "What was tapped"),
    field("Cutter", which, { name: "toolings" }),
    h("div", { class: "fields" }, Object.values(own), lowest),
    field("Unit of the FRFs", units, { name: "tip.units" }),
  );
  const value = (key) => own[key].input.base;
  const cutter = () => ({ teeth: value("teeth"), diameter_mm: value("dia"), ...(value("helix") === null ? {} : { helix_deg: value("helix") }) });
  const body = () => ({
    tip: {
      frf: tapped().map(({ text, axes, correction }) => ({ text, ...(axes ? { axes } : {}), ...(correction ? { correction } : {}) })),
      ...(units.value ? { units: units.value } : {}),
      ...(lowest.input.base === null ? {} : { from_hz: lowest.input.base }),
      ...(which.value ? {} : { cutter: cutter() }),
    },
  });
  const faults = () =>
    (which.value ? [] : CUTTER.slice(0, 2))
      .filter(([key]) => value(key) === null)
      .map(([, , name]) => ({ field: `cutter.${name}`, found: "nothing", allowed: "A number is needed here" }));
  const address = () => ({
    ...Object.fromEntries(CUTTER.map(([key]) => [key, which.value ? null : value(key)])),
    low: lowest.input.base,
    units: units.value,
  });
  const names = () => (which.value ? [which.value] : []);
  // as the service calls a cutter that has no name
  const summaries = () => (which.value ? toolings : [{ name: "tip", shape: "flat", stickout_mm: null, ...cutter() }]);
  const shaped = toolings.some((each) => each.shape !== "flat");
  return { element, body, address, faults, summaries, names, material: null, shaped };
}
