// The editor of a tooling: cutter, tool, holder, contact, and the drawing beside them as they change.
import { getText, part, Problem, send, get } from "../api.js";
import { add, card, fill, h, head, link, save, tell } from "../dom.js";
import { drawn, picture } from "../drawing.js";
import { busy, clearFaults, confirmed, declaredField, failed, field, quantity, showProblem } from "../forms.js";
import { go, holdsEdits, to } from "../router.js";
import { machine } from "../state.js";
import { q, text } from "../units.js";
import { trail } from "./changes.js";
import { contactCard } from "./contact_card.js";
import { cutterShape } from "./cutter_shape.js";
import { doubtCard } from "./doubt_card.js";
import { catalogueBox } from "./holder_catalogue.js";
import { segmentsTable } from "./segments.js";
import { START } from "./tooling_start.js";

// of the tool inside the bore, in diameters of its shank: below it no clamping holds; as where the library asks for stickouts
const LEAST_INSERTION = 1;

export async function view({ name = "" }, query, place) {
  const from = name || query.get("from");
  const [there, { nouns }] = await Promise.all([from ? get(`toolings/${part(from)}`) : null, get("fields")]);
  const keys = structuredClone(there?.tooling ?? START);
  const copied = from && !name;
  const title = name || (copied ? `Copy of ${from}` : "A new tooling");
  const called = h("input", { autocomplete: "off", maxlength: 64 });
  called.value = name || (copied ? `${from}-copy` : "");

  const always = nouns.cutter.filter(({ label, needed }) => label && needed);
  const cutter = Object.fromEntries(always.map((each) => [each.key, declaredField(each, "cutter", keys.cutter[each.key])]));
  const helix = h("input", { autocomplete: "off", placeholder: "0" });
  helix.value = [keys.cutter.helix_deg ?? 0].flat().join(", ");
  const shape = cutterShape(nouns.cutter, keys.cutter);
  const pitch = h("input", { autocomplete: "off", placeholder: "equal" });
  pitch.value = (keys.cutter.pitch_deg ?? []).join(", ");
  const stickout = quantity("Stickout", "length", keys.tool.stickout_mm, { name: "tool.stickout_mm", hint: "Tip to the holder's face" });
  const insertion = quantity("Insertion", "length", keys.holder.insertion_mm, {
    name: "holder.insertion_mm",
    hint: "How deep the tool sits",
  });
  const tool = segmentsTable(nouns.segment, "Tool, from its tip", "tool.segments", keys.tool.segments, () => changed());
  const holder = segmentsTable(nouns.segment, "Holder, from the tool to the flange", "holder.segments", keys.holder.segments, () => changed());
  const taper = h("input", { autocomplete: "off", maxlength: 200 });
  taper.value = keys.holder.taper ?? "";
  const contact = contactCard(nouns.contact, keys);
  const doubts = doubtCard(nouns.spread, keys, !name);

  /** The diameter of the tool where it is clamped. */
  function shank() {
    const last = tool.rows().at(-1);
    return last.end_diameter_mm ?? last.outer_diameter_mm;
  }
  function takeHolder(found, behind) {
    holder.replace(found.holder.segments);
    taper.value = behind;
    if (found.contact) contact.take(found.contact.keys);
    doubts.take(found.spread);
    deep = insertion.input.base = found.holder.insertion_mm;
    reclamp();
    changed();
  }

  // how deep the tool shall sit where it is long enough
  let deep = insertion.input.base;
  const offer = h("div", { role: "status" });
  insertion.input.addEventListener("input", () => (deep = insertion.input.base));
  stickout.input.addEventListener("input", reclamp);
  /** A tool keeps its length: further out it sits less deep, and only a person makes it longer. */
  function reclamp() {
    offer.replaceChildren();
    const length = tool.rows().reduce((sum, each) => sum + each.length_mm, 0);
    const out = stickout.input.base;
    const least = Math.min(deep, LEAST_INSERTION * shank());
    if (![length, out, least].every(Number.isFinite) || out === null || out <= 0) return;
    insertion.input.base = Math.max(least, Math.min(deep, Number((length - out).toFixed(6))));
    const short = Number((out + least - length).toFixed(6));
    if (short <= 0) return;
    const longer = () => {
      tool.lengthen(short);
      reclamp();
    };
    add(
      offer,
      h(
        "p",
        { class: "note doubt" },
        "The tool is ",
        q("length", length, { digits: 1 }),
        " long, and no less than ",
        q("length", least, { digits: 1 }),
        " of it hold in the bore. ",
        h("button", { type: "button", class: "quiet", onclick: longer }, `Make the tool ${text("length", short, { digits: 1 })} longer`),
      ),
    );
  }

  const image = picture("The tooling, to scale");
  const doubt = h("div", { class: "fault", role: "status" });
  const store = h("button", { class: "primary" }, name ? "Save" : "Put into the library");
  const fault = h("div");
  const form = h(
    "form",
    { class: "editor", novalidate: true },
    card(
      "Name and cutter",
      null,
      h(
        "div",
        { class: "fields" },
        field("Name", called, { name: "name", hint: "Letters, digits and . _ + ( ) -", double: true }),
        Object.values(cutter),
        field("Helix [°]", helix, { name: "cutter.helix_deg", hint: "One, or one a tooth with commas" }),
        field("Pitch angles [°]", pitch, { name: "cutter.pitch_deg", hint: "For unequal pitch, with commas" }),
        stickout,
        insertion,
      ),
      offer,
    ),
    card("Shape of the edges", null, shape.parts),
    card("Tool", null, tool.box),
    card(
      "Holder",
      null,
      holder.box,
      catalogueBox(shank, takeHolder),
      h("div", { class: "fields" }, field("Behind the flange", taper, { name: "holder.taper", hint: "HSK-A63, BT40 …: hung on a string, it rings, too", double: true })),
    ),
    contact.box,
    doubts.box,
  );
  add(
    place,
    head(
      title,
      null,
      name && machine()?.identification ? link(to("change", { tooling: name }), "Lobes", "button") : null,
      name ? link(to(`toolings/ring/${part(name)}`), "Ring it", "button quiet") : null,
      name ? link(to("toolings/new", { from: name }), "Copy", "button quiet") : null,
      name ? h("button", { type: "button", class: "quiet", onclick: download }, "TOML file") : null,
      name ? h("button", { type: "button", class: "quiet danger", onclick: remove }, "Delete") : null,
    ),
    fault,
    h(
      "div",
      { class: "bench" },
      h("section", { class: "card sheet", "aria-label": "Drawing" }, image, doubt, h("div", { class: "row-of-buttons" }, store)),
      form,
    ),
  );
  store.setAttribute("form", (form.id = "tooling-form"));
  // what is shown, not what is stored: an empty field and no key are the same here
  const state = () => JSON.stringify([...form.querySelectorAll("input, select, textarea")].map((each) => each.value));
  let saved = state();
  holdsEdits(() => state() !== saved);

  function written() {
    const found = {
      ...keys,
      cutter: {
        ...keys.cutter,
        teeth: whole(cutter.teeth.input.base),
        diameter_mm: cutter.diameter_mm.input.base,
        helix_deg: angles(helix).length > 1 ? angles(helix) : (angles(helix)[0] ?? 0),
      },
      tool: { ...keys.tool, stickout_mm: stickout.input.base, segments: tool.rows() },
      holder: { ...keys.holder, insertion_mm: insertion.input.base, segments: holder.rows() },
    };
    if (taper.value.trim()) found.holder.taper = taper.value.trim();
    else delete found.holder.taper;
    shape.write(found.cutter);
    if (angles(pitch).length) found.cutter.pitch_deg = angles(pitch);
    else delete found.cutter.pitch_deg;
    contact.write(found);
    doubts.write(found);
    if (called.value.trim()) found.name = found.name && name ? found.name : called.value.trim();
    else delete found.name;
    return found;
  }

  let timer = null;
  let asking = null;
  async function draw() {
    asking?.abort();
    asking = new AbortController();
    const { signal } = asking;
    try {
      const svg = await drawn(written(), signal);
      if (signal.aborted) return;
      clearFaults(form);
      doubt.replaceChildren();
      image.show(svg);
      image.classList.remove("old");
    } catch (error) {
      if (error.name === "AbortError" || signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      image.classList.add("old");
      fill(doubt, "The drawing shows what was there before: something beside is not usable.");
      showProblem(form, error, { focus: false });
    }
  }
  function changed() {
    clearTimeout(timer);
    timer = setTimeout(draw, 250);
  }
  form.addEventListener("input", changed);
  form.addEventListener(
    "submit",
    busy(store, async () => {
      clearTimeout(timer);
      asking?.abort();
      clearFaults(form);
      const wanted = called.value.trim();
      if (!wanted)
        return void showProblem(
          form,
          new Problem(0, { detail: "", errors: [{ field: "name", found: "nothing", allowed: "A name, so that you find it again" }] }),
        );
      const before = wanted === name ? { "If-Match": `"${there.etag}"` } : { "If-None-Match": "*" };
      try {
        const kept = await (await send("PUT", `toolings/${part(wanted)}`, { json: written(), headers: before })).json();
        tell(`${wanted} is in the library.`);
        saved = state();
        if (wanted === name) {
          there.etag = kept.etag;
          await versions();
        } else go(`toolings/edit/${part(wanted)}`);
      } catch (error) {
        if (error.status === 412) {
          const words =
            wanted === name
              ? "Somebody else has changed it meanwhile; take another name, or load the page again"
              : "A name that is not in the library yet";
          showProblem(form, new Problem(412, { detail: "", errors: [{ field: "name", found: wanted, allowed: words }] }));
        } else showProblem(form, error);
      }
    }),
  );

  async function versions() {
    fill(history, await trail({ kind: "tooling", name }));
  }
  async function download() {
    try {
      save(`${name}.toml`, await getText(`toolings/${part(name)}`, "application/toml"), "application/toml");
    } catch (error) {
      failed(fault, error);
    }
  }
  async function remove() {
    if (!(await confirmed(`Delete ${name}?`, "Campaigns that used it keep what they need; its versions stay, too.", "Delete it"))) return;
    try {
      await send("DELETE", `toolings/${part(name)}`);
      saved = state();
      go("toolings");
    } catch (error) {
      failed(fault, error);
    }
  }
  const history = h("div");
  if (name) {
    add(place, card("Versions", null, history));
    await versions();
  }
  await draw();
  return () => {
    clearTimeout(timer);
    asking?.abort();
  };
}

/** Angles of a field that takes several. */
const angles = (input) =>
  input.value
    .split(/[;,\s]+/)
    .filter(Boolean)
    .map(Number);
// what is not a whole number goes to the service as it is: it says what it wants
const whole = (value) => value;
