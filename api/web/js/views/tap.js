// Hits of a hammer to an FRF: dropped, averaged, looked at, and handed on as a file.
import { send } from "../api.js";
import { axis, chart, colour, legend } from "../charts.js";
import { add, card, fill, h, head, mark, note, save, table, waiting, whisper } from "../dom.js";
import { dropZone } from "../drop.js";
import { frfFigure } from "../figures.js";
import { busy, clearFaults, failed, field, quantity, select, showProblem } from "../forms.js";
import { go } from "../router.js";
import { addTapped } from "../tapped.js";
import { factor, plain, q, quantityInput, significant } from "../units.js";
import { listenTabs } from "./listen.js";

/** Share of the hammer's band below which nothing is read off by itself. */
const LOWEST = 0.03;
/** Digits that are handed on: no measurement has more. */
const DIGITS = 7;

export async function view(_args, _query, place) {
  const direction = select([["X", "X"], ["Y", "Y"]], "X");
  const measures = select(
    [
      ["acceleration", "acceleration"],
      ["velocity", "velocity"],
      ["displacement", "displacement"],
    ],
    "acceleration",
  );
  const estimator = select(
    [
      ["h1", "H1: noise in the response"],
      ["h2", "H2: noise in the force"],
      ["hv", "their mean"],
    ],
    "h1",
  );
  const force = h("input", { autocomplete: "off", maxlength: 128 });
  const response = h("input", { autocomplete: "off", maxlength: 128 });
  const mass = quantityInput("none", null);
  const rate = quantity("Sampling rate", "hertz", null, { name: "rate_hz", hint: "Of files that tell none" });
  const again = h("button", { hidden: true }, "Average again");
  const form = h(
    "form",
    { class: "card", novalidate: true },
    h("h2", null, "What you know of it"),
    h(
      "div",
      { class: "fields broad" },
      field("Direction", direction, { name: "axis" }),
      field("The response measures", measures, { name: "quantity", hint: "Where its unit does not say" }),
      field("Mass of the sensor", mass, { name: "sensor_mass_g", unit: h("span", null, "g"), hint: "At the point that is hit" }),
    ),
    h(
      "details",
      null,
      h("summary", null, "Channels and estimator"),
      h(
        "div",
        { class: "fields broad" },
        field("Channel of the hammer", force, { name: "force", hint: "Told by its pulses if left empty" }),
        field("Channel of the response", response, { name: "response", hint: "The only other one if left empty" }),
        field("Estimator", estimator, { name: "estimator" }),
        rate,
      ),
    ),
    h("p", null, again),
  );
  const answers = h("div", { class: "view" });
  let last = null;

  /** What is asked of files, as the form has it now. */
  function asked() {
    const found = [
      ["axis", direction.value],
      ["quantity", measures.value],
      ["estimator", estimator.value],
      ["force", force.value.trim()],
      ["response", response.value.trim()],
      ["sensor_mass_g", mass.base ?? ""],
      ["rate_hz", rate.input.base ?? ""],
    ].filter(([, value]) => value !== "");
    return new URLSearchParams(found);
  }

  /** Ask for the receptance of files, in one of the forms that the service has. */
  function ask({ files, query }, accept) {
    const body = new FormData();
    for (const file of files) body.append("hits", file);
    return send("POST", `tap?${query}`, { body, headers: { Accept: accept } });
  }

  function refused(error) {
    const fields = (error.errors ?? []).map((each) => each.field);
    if (fields.some((name) => form.querySelector(`[data-field="${CSS.escape(name)}"]`))) showProblem(form, error);
    else failed(answers, error);
  }

  async function average(files) {
    last = files;
    clearFaults(form);
    again.hidden = false;
    fill(answers, waiting("Looking at the hits …"));
    try {
      // what is handed on is what is shown, whatever the form says by then
      const question = { files, query: asked() };
      const found = await (await ask(question, "application/json")).json();
      if (last !== files) return;
      fill(answers, shown(found, (kind, name) => download(question, kind, name), (axes) => lobes(question, axes, found)));
      whisper(`A receptance from ${found.used} of ${found.hits.length} hits`);
      answers.scrollIntoView({ block: "start" });
    } catch (error) {
      if (last !== files) return;
      fill(answers);
      refused(error);
    }
  }

  async function download(question, kind, name) {
    try {
      save(name, await (await ask(question, kind)).blob());
    } catch (error) {
      refused(error);
    }
  }

  /** On to the lobes, with all lines that the hammer excites. */
  async function lobes(question, axes, found) {
    try {
      const [names, ...lines] = (await (await ask(question, "text/csv")).text()).trim().split("\n");
      const rows = lines.map((line) => line.split(",").map(Number)).filter(([frequency]) => frequency <= found.band_hz[1]);
      const text = [names, ...rows.map((row) => row.map((value) => value.toPrecision(DIGITS)).join(","))].join("\n");
      addTapped({ name: `${found.used} hits along ${axes}`, text, axes });
      go("tip");
    } catch (error) {
      refused(error);
    }
  }

  form.addEventListener(
    "submit",
    busy(again, () => last && average(last)),
  );
  const zone = dropZone(
    "Drop hits of a hammer",
    "One recording with several hits, or several files, of hammer and response: CSV and other text; with the channels' names also HDF5, TDMS, UFF 58, WAV, MATLAB, Parquet.",
    average,
    { folder: false },
  );
  add(
    place,
    head("Hammer hits", "Raw hits become a receptance: double hits, overloads and others that do not fit are left out and named.", listenTabs("tap")),
    zone,
    form,
    answers,
  );
}

function shown(found, download, lobes) {
  const [name, curve] = Object.entries(found.axes)[0];
  const size = curve.re.map((re, k) => Math.hypot(re, curve.im[k]));
  // further down an accelerometer's noise grows with the period's square
  const seen = size.filter((_, k) => found.frequency_hz[k] > LOWEST * found.band_hz[1]);
  const [least, most] = [seen.reduce((a, b) => Math.min(a, b)), seen.reduce((a, b) => Math.max(a, b))];
  const k = size.lastIndexOf(most);
  const words = `Receptance ${name} from ${found.used} of ${found.hits.length} hits, largest at ${plain(found.frequency_hz[k])} Hz`;
  const picture = chart(words, "frf");
  picture.draw(() => {
    const figure = frfFigure([{ ...found, tooling: "hammer hits", cross: {} }], { parts: "polar", shown: "both" });
    figure.layout.yaxis.range = [0.7 * least, 1.5 * most].map((value) => Math.log10(value * factor("receptance")));
    return { ...figure, say: words };
  });
  const button = (kind, file) => h("button", { type: "button", onclick: () => download(kind, file) }, file);
  const onwards = h("button", { type: "button", class: "primary" }, "Lobes of this tip");
  onwards.addEventListener(
    "click",
    busy(onwards, () => lobes(name)),
  );
  return [
    card(
      "Receptance",
      h("span", { class: "row-of-buttons" }, button("text/csv", "FRF.csv"), button("application/x-uff", "FRF.uff"), onwards),
      h(
        "dl",
        { class: "facts" },
        fact("Largest", h("span", null, q("receptance", size[k]), ` at ${plain(found.frequency_hz[k], 1)} Hz`)),
        fact("Hits", `${found.used} of ${found.hits.length}`),
        fact("The hammer excites", `up to ${plain(found.band_hz[1])} Hz`),
      ),
      legend([{ name: `${name} direction`, series: "s1" }]),
      picture,
      h("p", { class: "small soft" }, "Shaded: 95 % band. The files hold every line, and are what ", h("code", null, "lobes --frf"), ", ", h("code", null, "decouple"), ", ", h("code", null, "compare"), " and ", h("code", null, "contact"), " take."),
      found.window_decay_per_s
        ? note("doubt", `The responses do not end: an exponential window adds ${significant(found.window_decay_per_s)} 1/s to the decay of every mode.`)
        : null,
      found.remarks.length ? h("ul", { class: "small" }, found.remarks.map((each) => h("li", null, each))) : null,
    ),
    coherenceCard(found),
    card("Hits", null, hitTable(found)),
  ];
}

const fact = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));

function coherenceCard(found) {
  if (!found.coherence) return card("Coherence", null, h("p", { class: "soft" }, "A single hit has none: hit several times to know how far the answer can be trusted."));
  const picture = chart("Coherence over frequency", "small");
  const line = { color: colour("s3"), width: 1.4 };
  picture.draw(() => ({
    data: [{ x: found.frequency_hz, y: found.coherence, type: "scatter", mode: "lines", line, hovertemplate: "%{x:,.0f} Hz: %{y:.3f}<extra></extra>" }],
    layout: { xaxis: axis("Frequency [Hz]", { tickformat: ",d" }), yaxis: axis("Coherence", { range: [0, 1.03] }) },
  }));
  return card("Coherence", null, h("p", { class: "small soft" }, "Near 1 the force explains the response; a dip at a resonance says that hits differ."), picture);
}

function hitTable(found) {
  return table(
    "Hits and what became of them",
    [
      { name: "Recording", cell: (hit) => hit.recording },
      { name: "Time", unit: "s", number: true, cell: (hit) => plain(hit.time_s, 3, 3) },
      { name: "Force", number: true, cell: (hit) => q("force", hit.force_n) },
      { name: "Used", cell: (hit) => (hit.left_out ? mark("bad", "left out") : mark("good", "used")) },
      { name: "Why not", cell: (hit) => h("div", { class: "why" }, hit.left_out ?? "") },
    ],
    found.hits,
    { tall: true },
  );
}
