// One recording: its signal, its spectrum with the harmonics marked, and what was found in it.
import { get, getBlob, part } from "../api.js";
import { add, card, choices, fill, h, head, link, note, save } from "../dom.js";
import { axis, chart, colour, legend, safe, SERIES } from "../charts.js";
import { failed } from "../forms.js";
import { to } from "../router.js";
import { plain } from "../units.js";
import { sizeOf } from "./machines.js";

export async function view({ id, name }, _query, place) {
  const campaign = await get(`campaigns/${id}`);
  const cut = campaign.cuts.find((each) => each.cut.name === name || each.air?.name === name);
  add(place, head(name, campaign.name, link(to(`campaigns/${id}`), "All cuts", "button")), cut ? recordingPanel(campaign, cut, name) : note("doubt", "The campaign names no such recording."));
}

/** What a row of the verdicts opens: the cut's recording, and its air cut's. */
export function recordingPanel(campaign, cut, first = null) {
  const box = h("div", { class: "view" });
  const names = [[cut.cut, "Cut"], [cut.air, "Air"]].filter(([file]) => file?.uploaded).map(([file, words]) => [file.name, words]);
  const chosen = first ?? names[0][0];
  const show = (name) => shown(box, campaign.id, name);
  show(chosen);
  return card(cut.id, names.length > 1 ? choices("Recording", names, chosen, show) : null, box);
}

async function shown(box, id, name) {
  const where = `campaigns/${part(id)}/recordings/${part(name)}`;
  const signal = chart(`Signal of ${name}`, "small");
  const spectrum = chart(`Spectrum of ${name}`, "small tall");
  const facts = h("dl", { class: "facts" });
  const keys = h("div");
  const place = h("div");
  fill(box, facts, keys, h("h3", null, "Signal"), signal, h("h3", null, "Spectrum"), spectrum, place);
  try {
    const recording = await get(where);
    fill(facts, fact("Length", `${plain(recording.duration_s, 2)} s`), fact("Sampling rate", `${plain(recording.sampling_rate_hz)} Hz`),
      fact("Speed found", recording.spindle_speed_rpm === null ? "–" : `${plain(recording.spindle_speed_rpm, 1)} rev/min`),
      fact("Harmonics above noise", Object.entries(recording.harmonics_above_noise).map(([a, n]) => `${a} ${n}`).join(", ") || "–"),
      h("div", null, h("dt", null, "File"), h("dd", null, h("button", { type: "button", class: "quiet", onclick: async () => {
        try {
          save(name, await getBlob(`${where}/file`));
        } catch (error) {
          failed(place, error);
        }
      } }, sizeOf(recording.size_bytes)))));
    const [time, lines] = await Promise.all([get(`${where}/signal?points=1000`), get(`${where}/spectrum`)]);
    const names = Object.keys(time.channels);
    fill(keys, legend(names.map((each, i) => ({ name: `${each} [${time.channels[each].unit}]`, series: SERIES[i % SERIES.length] }))));
    signal.draw(() => signalFigure(time, names));
    spectrum.draw(() => spectrumFigure(lines, names));
  } catch (error) {
    failed(place, error);
  }
}

const fact = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));

/** Channels of another unit than the first have an axis of their own, on the right. */
function unitsOf(channels, names) {
  const units = [...new Set(names.map((name) => channels[name].unit))];
  return { units, axisOf: (name) => (units.indexOf(channels[name].unit) === 0 ? "y" : "y2") };
}

function signalFigure({ time_s: x, channels }, names) {
  const { units, axisOf } = unitsOf(channels, names);
  const data = names.flatMap((name, i) => {
    const { low, high } = channels[name];
    const line = { color: colour(SERIES[i % SERIES.length]), width: 0.8 };
    const common = { x, mode: "lines", type: "scatter", line, yaxis: axisOf(name), hoverinfo: "skip" };
    return [{ ...common, y: low }, { ...common, y: high, fill: "tonexty", fillcolor: colour(SERIES[i % SERIES.length], 0.45) }];
  });
  return { data, layout: { xaxis: axis("Time [s]"), ...sides(units) } };
}

function sides(units, more = {}) {
  const found = { yaxis: axis(`[${units[0]}]`, more) };
  if (units.length > 1) found.yaxis2 = axis(`[${units.slice(1).join(", ")}]`, { overlaying: "y", side: "right", showgrid: false, ...more });
  return found;
}

function spectrumFigure({ frequency_hz: x, channels, harmonics_hz: harmonics }, names) {
  const { units, axisOf } = unitsOf(channels, names);
  const data = names.map((name, i) => ({
    x, y: channels[name].amplitude, name: safe(name), mode: "lines", type: "scatter", line: { color: colour(SERIES[i % SERIES.length]), width: 1.2 }, yaxis: axisOf(name),
    hovertemplate: `${safe(name)} %{y:.3~g} ${channels[name].unit}<extra></extra>`,
  }));
  const line = { color: colour("soft", 0.55), width: 1, dash: "dot" };
  const shapes = harmonics.slice(0, 400).map((f) => ({ type: "line", x0: f, x1: f, y0: 0, y1: 1, yref: "paper", line, layer: "below" }));
  const last = harmonics.at(-1);
  const range = last ? [0, Math.min(x.at(-1), last * 1.15)] : undefined;
  return {
    data, layout: { hovermode: "x", shapes, xaxis: axis("Frequency [Hz]", { tickformat: ",d", range }), ...sides(units, { type: "log", exponentformat: "power", dtick: 1 }) },
    say: `Spectrum with ${harmonics.length} tooth-passing harmonics marked.`,
  };
}
