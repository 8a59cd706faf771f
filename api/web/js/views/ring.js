// A tooling hung on a string and tapped: its sounds, recorded here or dropped, correct its drawing.
import { get, part, send } from "../api.js";
import { chart, legend } from "../charts.js";
import { add, card, choices, fill, h, head, link, mark, note, table, tell, waiting, whisper } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, clearFaults, failed, field, quantity, showProblem } from "../forms.js";
import { go, to } from "../router.js";
import { ringFigure } from "../ring_figure.js";
import { plain, quantityInput } from "../units.js";
import { recorderCard } from "./recorder_card.js";
import { beforeAndAfter, OWN, withSpread } from "./spreads.js";

/** Parts of the form, and what each is the sound of. */
const RINGS = [
  ["sounds", "Tool in its holder"],
  ["bare_tool", "Tool alone"],
];
const HOW = "Hang it on a string, hold the microphone a hand's breadth beside it, be quiet, and tap it three or four times with something hard.";

export async function view({ name }, _query, place) {
  const there = await get(`toolings/${part(name)}`);
  const mass = quantityInput("none", null);
  const rate = quantity("Sampling rate", "hertz", null, { name: "rate_hz", hint: "Of files that tell none" });
  const learn = h("button", null, "Learn from these");
  const list = h("div");
  const answers = h("div", { class: "view" });
  let sounds = [];
  let of = RINGS[0][0];
  const form = h(
    "form",
    { class: "card", novalidate: true },
    h("h2", null, "What is listened to"),
    list,
    h(
      "div",
      { class: "fields broad" },
      field("Mass of the tool alone", mass, { name: "mass_g", unit: h("span", null, "g"), hint: "If you have weighed it" }),
      rate,
    ),
    h("p", null, learn),
  );

  function listed() {
    fill(
      list,
      sounds.length
        ? table(
            "Sounds",
            [
              { name: "Sound", cell: (each) => each.file.name },
              { name: "Of", cell: (each) => RINGS.find(([field]) => field === each.of)[1].toLowerCase() },
              { name: "Remove", cell: (each) => h("button", { type: "button", class: "quiet", onclick: () => drop(each), "aria-label": `Leave out ${each.file.name}` }, "Leave out") },
            ],
            sounds,
          )
        : h("p", { class: "soft" }, "No sound yet. The tool in its holder tells most; the tool alone and its mass make it surer."),
    );
  }
  function drop(sound) {
    sounds = sounds.filter((each) => each !== sound);
    listed();
  }
  function take(files) {
    sounds = [...sounds, ...files.map((file) => ({ file, of }))];
    listed();
    return ask();
  }

  async function ask() {
    const asked = sounds;
    const body = new FormData();
    body.append("query", JSON.stringify({ tooling: name, mass_g: mass.base, rate_hz: rate.input.base, curves: true }));
    for (const each of asked) body.append(each.of, each.file);
    clearFaults(form);
    fill(answers, waiting("Listening …"));
    try {
      const found = await (await send("POST", "ring", { body })).json();
      if (sounds !== asked) return;
      fill(answers, ringAnswer(found, takeOver));
      whisper(`${found.heard.filter((line) => line.is).length} modes heard`);
      answers.scrollIntoView({ block: "start" });
    } catch (error) {
      if (sounds !== asked) return;
      fill(answers);
      const fields = (error.errors ?? []).map((each) => each.field);
      if (fields.some((each) => form.querySelector(`[data-field="${CSS.escape(each)}"]`))) showProblem(form, error);
      else failed(answers, error);
    }
  }

  async function takeOver(found, fault) {
    const heard = found.heard.filter((line) => line.is).map((line) => `${line.of} ${plain(line.frequency_hz)} Hz`);
    const why = new URLSearchParams({ why: `rung: ${heard.join(", ") || "weighed"}`.replaceAll("\u202f", "").slice(0, 200) });
    try {
      await send("PUT", `toolings/${part(name)}?${why}`, { json: found.learned, headers: { "If-Match": `"${found.etag}"` } });
      tell(`${name} is what its ring tells; what it was stays as a version.`);
      go(`toolings/edit/${part(name)}`);
    } catch (error) {
      failed(fault, error);
    }
  }

  form.addEventListener("submit", busy(learn, ask));
  const recorder = recorderCard((file) => take([file]), HOW);
  const zone = dropZone(
    "Drop sounds of its ring",
    "One with several hits, or several: WAV, FLAC, or a file of any sensor. Files compressed with losses tell frequencies, and nothing of damping.",
    take,
    { folder: false },
  );
  listed();
  add(
    place,
    head(`Ring ${name}`, "How it rings tells what its drawing does not: diameter of the flutes, material, contact in the holder.", link(to(`toolings/edit/${part(name)}`), "Back to the drawing", "button quiet")),
    there.tooling.holder.taper
      ? null
      : note("doubt", "The drawing does not say which taper is behind the holder's flange. It hangs on the string, too, and lowers what is heard: enter it first, under Holder."),
    h(
      "section",
      { class: "card" },
      h("h2", null, "What rings"),
      h("div", null, choices("What rings", RINGS, of, (value) => (of = value))),
    ),
    h("div", { class: "columns" }, matchMedia("(pointer: coarse)").matches ? [recorder, zone] : [zone, recorder]),
    form,
    answers,
  );
  return recorder.stop;
}

function ringAnswer(found, takeOver) {
  const fault = h("div");
  const good = found.status === "good";
  const button = h("button", { type: "button", class: good ? "primary" : null }, "Take over");
  button.addEventListener(
    "click",
    busy(button, () => takeOver(found, fault)),
  );
  return [
    card(
      "What its ring tells",
      mark(good ? "good" : "doubt", found.status),
      good ? null : note("doubt", `Drawing, spread and ring hardly go together (probability ${plain(100 * found.probability, 1)} %). Is it this tooling, and as it is drawn?`),
      found.remarks.length ? note("doubt", ...found.remarks.map(sentence)) : null,
      table("The drawing before and after", beforeAndAfter("Drawn", (r) => [r.before, r.before_std], "Learned", (r) => [r.after, r.after_std]), found.changes),
      h("div", { class: "row-of-buttons" }, button, h("span", { class: "soft" }, "writes a new version of the tooling; the present one stays in its history")),
      h("p", { class: "small soft" }, OWN),
      fault,
    ),
    ...(found.curves ?? []).map((curve) => spectrumCard(curve, found.heard.filter((line) => line.of === curve.of))),
    card("Lines that were heard", null, lines(found.heard)),
  ];
}

const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;

function spectrumCard(curve, heard) {
  const words = `Spectrum of the ${curve.of}: ${heard.map((line) => `${line.is ?? "another line"} at ${plain(line.frequency_hz)} Hz`).join(", ")}`;
  const picture = chart(words, "small tall");
  picture.draw(() => ({ say: words, ...ringFigure(curve, heard) }));
  const keys = [
    { name: "heard, a mode of it", series: "s2" },
    ...(heard.some((line) => !line.is) ? [{ name: "heard, no mode of it", series: "s6", dash: "dot" }] : []),
    ...(heard.some((line) => line.drawn_hz) ? [{ name: "where the drawing expects it", series: "s3", dash: "dash" }] : []),
  ];
  return card(`Spectrum, ${curve.of}`, null, legend(keys), picture);
}

const lines = (heard) =>
  table(
    "Lines that were heard",
    [
      { name: "It is", cell: (line) => line.is ?? h("span", { class: "soft" }, "no mode of it") },
      { name: "Of", cell: (line) => line.of },
      { name: "Frequency", unit: "Hz", number: true, cell: (line) => withSpread(line.frequency_hz, line.frequency_std_hz) },
      { name: "Drawn", unit: "Hz", number: true, cell: (line) => plain(line.drawn_hz) },
      { name: "Learned", unit: "Hz", number: true, cell: (line) => plain(line.learned_hz) },
      { name: "Damping", unit: "%", number: true, cell: (line) => withSpread(line.damping_percent, line.damping_std_percent) },
    ],
    heard,
  );
