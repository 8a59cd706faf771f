// The first page: which machines there are, how far each is known, and a place to drop recordings.
import { get, getBlob, once, part, post } from "../api.js";
import { add, card, fill, h, head, link, save } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, failed, field, showProblem } from "../forms.js";
import { exampleCard, tryButton } from "../next_step.js";
import { go, to } from "../router.js";
import { runningFor } from "../running.js";
import { allMachines, choose } from "../state.js";
import { intake } from "./intake.js";
import { statusMark } from "./machine.js";

export async function view(_args, _query, place) {
  const machines = await allMachines(true);
  const box = h("div", { class: "view" });
  const zone = dropZone(
    "Drop a campaign here",
    "Its folder, a ZIP of it, or its files: campaign.toml, tooling files, recordings (HDF5, TDMS, UFF 58, WAV and other sound, MATLAB, Parquet, CSV), FRFs of hammer tests.",
    (files) => intake(box, files),
  );
  if (!machines.length) {
    add(
      place,
      head(
        "Spindle dynamics from ordinary cuts",
        "Recordings of cuts you make anyway go in. Tooltip FRFs, stability lobes and forces of any tooling come out.",
      ),
      box,
      h("div", { class: "columns" }, listenCard(), exampleCard(box)),
      zone,
      h(
        "ol",
        { class: "way" },
        stage("Drop recordings in", "Each one gets its verdict at once: usable or not, and why."),
        stage("Identify the machine", "You watch the search; modes come with their uncertainties."),
        stage("Change the tool", "Best speeds, lobes and tooltip FRFs of toolings that never cut."),
      ),
      h("div", { class: "columns" }, makeCard(), examples(box)),
    );
    return;
  }
  add(
    place,
    head("Machines", null),
    h("div", { class: "columns" }, machines.map(machineCard)),
    box,
    zone,
    h("div", { class: "columns" }, makeCard(), examples(box, !machines.some((m) => m.example))),
  );
}

/** The door that asks for nothing: no machine, no campaign. */
const listenCard = () =>
  card(
    "Only one recording, or a phone?",
    null,
    h("p", null, "Listen to a cut: stable or chatter, how fast the spindle turns, and which speed to try next. Nothing else is needed."),
    h("div", { class: "row-of-buttons" }, link(to("listen"), "Listen to a cut", "button primary"), link(to("tap"), "Hammer hits", "button")),
  );

const stage = (title, words) => h("li", null, h("strong", null, title), h("span", { class: "soft" }, words));

function machineCard(machine) {
  const known = machine.identification;
  return h(
    "section",
    { class: "card" },
    h("header", null, h("h2", null, link(to(`machines/${machine.id}`), machine.name)), statusMark(machine)),
    machine.description && h("p", { class: "soft" }, machine.description),
    known
      ? h(
          "p",
          null,
          `Axes ${known.axes.join(" and ") || "none"}, ${Math.round(known.band_hz[0])} to ${Math.round(known.band_hz[1])} Hz, ${known.status === "measured" ? "measured at the flange" : `from “${known.campaign}”`}.`,
        )
      : h("p", { class: "soft" }, "Nothing is known of its dynamics yet."),
    h(
      "div",
      { class: "row-of-buttons" },
      known && known.axes.length
        ? link(to("change", { machine: machine.id }), "Tool change", "button primary")
        : runningFor(machine.id)
          ? link(to(`identifications/${runningFor(machine.id).id}`), "Watch its identification", "button primary")
          : link(to(`machines/${machine.id}/recordings`), "Recordings", "button primary"),
      link(to(`machines/${machine.id}`), "Look closer", "button"),
    ),
  );
}

function makeCard() {
  const name = h("input", { autocomplete: "off", maxlength: 64 });
  const words = h("input", { autocomplete: "off", maxlength: 200 });
  const button = h("button", null, "Make it");
  const form = h(
    "form",
    { novalidate: true },
    h(
      "div",
      { class: "fields" },
      field("Name", name, { name: "name", hint: "Such as HPM 800U" }),
      field("Where, or what", words, { name: "description" }),
    ),
    h("p", null, button),
  );
  form.addEventListener(
    "submit",
    busy(button, async () => {
      try {
        const made = await post("machines", { name: name.value.trim(), description: words.value.trim() }, { headers: once() });
        choose(made.id);
        await allMachines(true);
        go(`machines/${made.id}`);
      } catch (error) {
        showProblem(form, error);
      }
    }),
  );
  return card("A new machine", null, form);
}

/** Files to try the service with: downloaded, or a campaign taken in right here. */
function examples(box, offered = false) {
  const list = h("div");
  const fetched = (item) => getBlob(`examples/${part(item.name)}`);
  const acting = (item, label, work) => {
    const button = h("button", { type: "button", class: "quiet", "aria-label": `${label}: ${item.name}` }, label);
    button.addEventListener(
      "click",
      busy(button, async () => {
        try {
          await work(await fetched(item));
        } catch (error) {
          failed(box, error);
        }
      }),
    );
    return button;
  };
  get("examples")
    .then(({ items }) => {
      // what can be taken in at once comes first
      const zips = items.filter((item) => /\.zip$/.test(item.name)).reverse();
      const lines = [...zips, ...items.filter((item) => !zips.includes(item))].map((item) =>
        h(
          "li",
          null,
          h("div", null, h("strong", null, item.name), h("span", { class: "soft small" }, ` ${sizeOf(item.size_bytes)} · ${item.about}`)),
          acting(item, "Download", (blob) => save(item.name, blob)),
          /campaign\.zip$/.test(item.name) ? acting(item, "Take it in", (blob) => intake(box, [new File([blob], item.name)])) : null,
        ),
      );
      const trial = offered ? h("div", { class: "row-of-buttons" }, tryButton(box, "")) : null;
      fill(list, card("Example files", null, trial, h("ul", { class: "plain" }, lines)));
    })
    .catch((error) => failed(list, error));
  return list;
}

export function sizeOf(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
