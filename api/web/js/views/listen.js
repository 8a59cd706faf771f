// What one recording says: dropped, or recorded here with the microphone; no machine and no campaign is needed.
import { send } from "../api.js";
import { add, fill, h, head, tell, waiting, whisper } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, clearFaults, failed, field, quantity, select, showProblem } from "../forms.js";
import { remember, to } from "../router.js";
import { listenAnswer, said } from "./listen_answer.js";
import { recorderCard } from "./recorder_card.js";

/** What the address keeps. */
const KEPT = ["teeth", "speed_rpm", "speeds_from", "speeds_to"];

export function listenTabs(here) {
  return h(
    "nav",
    { class: "switch links", "aria-label": "Listen" },
    [
      ["listen", "To a cut"],
      ["tap", "Hammer hits"],
      ["tip", "Lobes of a tip"],
    ].map(([path, words]) => h("a", { href: to(path), class: "button", "aria-current": path === here ? "page" : null }, words)),
  );
}

export async function view(_args, query, place) {
  const given = Object.fromEntries(KEPT.map((name) => [name, query.get(name) ? Number(query.get(name)) : null]));
  const teeth = quantity("Teeth of the cutter", "none", given.teeth, { name: "teeth", hint: "Heard if left empty", props: { inputmode: "numeric" } });
  const speed = quantity("Programmed speed", "speed", given.speed_rpm, { name: "speed_rpm", hint: "Found if left empty" });
  const from = quantity("Lowest speed", "speed", given.speeds_from, { name: "speeds_from" });
  const upTo = quantity("Highest speed", "speed", given.speeds_to, { name: "speeds_to" });
  const rate = quantity("Sampling rate", "hertz", null, { name: "rate_hz", hint: "Of a file that tells none" });
  const sensitivity = quantity("Sensitivity", "none", null, { name: "sensitivity", hint: "Volts per SI unit, of a file in volts" });
  const channel = h("input", { autocomplete: "off", maxlength: 128 });
  const measures = select(
    [
      ["", "as the file says"],
      ["acceleration", "acceleration"],
      ["sound", "sound"],
      ["displacement", "displacement"],
      ["force", "force"],
    ],
    "",
  );
  const again = h("button", { hidden: true }, "Listen again");
  const form = h(
    "form",
    { class: "card", novalidate: true },
    h("h2", null, "What you know of it"),
    h("p", { class: "soft" }, "Nothing of it is needed. The number of teeth helps most: with it a speed to try is told."),
    h("div", { class: "fields broad" }, teeth, speed),
    h(
      "details",
      null,
      h("summary", null, "Speeds of the machine, and what the file does not tell"),
      h(
        "div",
        { class: "fields broad" },
        from,
        upTo,
        field("It measures", measures, { name: "quantity" }),
        field("Channel", channel, { name: "channel", hint: "Of several; all of one kind if left empty" }),
        rate,
        sensitivity,
      ),
    ),
    h("p", null, again),
  );
  const answers = h("div", { class: "view" });
  let last = null;

  function asked() {
    const numbers = { teeth, speed_rpm: speed, speeds_from: from, speeds_to: upTo, rate_hz: rate, sensitivity };
    const found = Object.entries(numbers).map(([name, box]) => [name, box.input.base]);
    found.push(["quantity", measures.value], ["channel", channel.value.trim()]);
    return new URLSearchParams(found.filter(([, value]) => value !== null && value !== ""));
  }

  async function hear(file) {
    const question = asked();
    remember("listen", Object.fromEntries(KEPT.map((name) => [name, question.get(name)])));
    clearFaults(form);
    last = file;
    again.hidden = false;
    fill(answers, waiting(`Listening to ${file.name} …`));
    question.set("name", file.name);
    question.set("curves", "true");
    try {
      const headers = { "Content-Type": "application/octet-stream" };
      const found = await (await send("POST", `listen?${question}`, { body: file, headers })).json();
      if (last !== file) return;
      fill(answers, listenAnswer(found, file));
      whisper(said(found));
      answers.scrollIntoView({ block: "start" });
    } catch (error) {
      if (last !== file) return;
      fill(answers);
      const fields = (error.errors ?? []).map((each) => each.field);
      if (fields.some((name) => form.querySelector(`[data-field="${CSS.escape(name)}"]`))) showProblem(form, error);
      else failed(answers, error);
    }
  }

  form.addEventListener(
    "submit",
    busy(again, () => last && hear(last)),
  );
  const zone = dropZone(
    "Drop a recording of a cut",
    "The sound of a phone as WAV, or a file of any sensor: CSV and other text, FLAC, HDF5, TDMS, UFF 58, MATLAB, Parquet.",
    (files) => {
      if (files.length > 1) tell(`${files[0].name} is listened to: one recording at a time.`);
      return hear(files[0]);
    },
    { folder: false },
  );
  const recorder = recorderCard(hear);
  add(
    place,
    head("Listen", "One recording of a cut says at once: stable or chatter, how fast the spindle turns, and which speed to try next.", listenTabs("listen")),
    // who holds a phone records, who sits at a desk has a file
    h("div", { class: "columns" }, matchMedia("(pointer: coarse)").matches ? [recorder, zone] : [zone, recorder]),
    form,
    answers,
  );
  return recorder.stop;
}
