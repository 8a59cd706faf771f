// One recording: its signal, its spectrum with the harmonics marked, and what was found in it.
import { get, getBlob, part } from "../api.js";
import { add, card, choices, fill, h, head, link, note, save } from "../dom.js";
import { axis, chart, colour, decades, legend, safe, SERIES } from "../charts.js";
import { failed } from "../forms.js";
import { go, to } from "../router.js";
import { factor, plain, unit } from "../units.js";
import { sizeOf } from "./machines.js";

export async function view({ id, name }, _query, place) {
  const campaign = await get(`campaigns/${id}`);
  const cut = campaign.cuts.find((each) => each.cut.name === name || each.air?.name === name);
  add(
    place,
    head(name, campaign.name, link(to(`campaigns/${id}`), "All cuts", "button")),
    cut ? recordingPanel(campaign, cut, name, (other) => go(`campaigns/${id}/${part(other)}`)) : note("doubt", "The campaign names no such recording."),
  );
}

/** What a row of the verdicts opens: the cut's recording, and its air cut's; `onpick` hears which one is looked at. */
export function recordingPanel(campaign, cut, first, onpick) {
  const box = h("div", { class: "view" });
  const names = [
    [cut.cut, "Cut"],
    [cut.air, "Air"],
  ]
    .filter(([file]) => file?.uploaded)
    .map(([file, words]) => [file.name, words]);
  const chosen = first ?? names[0][0];
  const show = (name) => shown(box, campaign.id, name);
  show(chosen);
  const pick = (name) => {
    show(name);
    onpick(name);
  };
  return card(cut.id, names.length > 1 ? choices("Recording", names, chosen, pick) : null, box);
}

async function shown(box, id, name) {
  const where = `campaigns/${part(id)}/recordings/${part(name)}`;
  const signal = chart(`Signal of ${name}`, "small tall");
  const spectrum = chart(`Spectrum of ${name}`, "small tall");
  const facts = h("dl", { class: "facts" });
  const keys = h("div");
  const place = h("div");
  fill(
    box,
    facts,
    keys,
    h("h3", null, "Signal"),
    signal,
    h("h3", null, "Spectrum, multiples of the spindle's frequency dotted"),
    spectrum,
    place,
  );
  try {
    const recording = await get(where);
    fill(
      facts,
      fact("Length", `${plain(recording.duration_s, 2)} s`),
      fact("Sampling rate", `${plain(recording.sampling_rate_hz)} Hz`),
      fact("Speed found", recording.spindle_speed_rpm === null ? "–" : `${plain(recording.spindle_speed_rpm, 1)} rev/min`),
      fact(
        "Harmonics above noise",
        Object.entries(recording.harmonics_above_noise)
          .map(([a, n]) => `${a} ${n}`)
          .join(", ") || "–",
      ),
      h(
        "div",
        null,
        h("dt", null, "File"),
        h(
          "dd",
          null,
          h(
            "button",
            {
              type: "button",
              class: "quiet",
              onclick: async () => {
                try {
                  save(name, await getBlob(`${where}/file`));
                } catch (error) {
                  failed(place, error);
                }
              },
            },
            sizeOf(recording.size_bytes),
          ),
        ),
      ),
    );
    const [time, lines] = await Promise.all([get(`${where}/signal?points=1000`), get(`${where}/spectrum`)]);
    const names = Object.keys(time.channels);
    fill(keys, legend(names.map((each, i) => ({ name: each, series: SERIES[i % SERIES.length] }))));
    signal.draw(() => signalFigure(time, names));
    spectrum.draw(() => spectrumFigure(lines, names));
  } catch (error) {
    failed(place, error);
  }
}

const fact = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));

/** Channels grouped by their unit, a panel each: displacements in micrometres, as people say them. */
function panels(channels, names) {
  const units = [...new Set(names.map((name) => channels[name].unit))];
  const gap = 0.1;
  const height = (1 - gap * (units.length - 1)) / units.length;
  return units.map((given, k) => {
    const [kind, times] = given === "m" ? ["displacement", 1e6 * factor("displacement")] : [null, 1];
    const end = 1 - k * (height + gap);
    return {
      names: names.filter((name) => channels[name].unit === given),
      yaxis: k ? `y${k + 1}` : "y",
      layoutKey: k ? `yaxis${k + 1}` : "yaxis",
      times,
      title: kind ? unit(kind) : given.replace("^2", "²"),
      domain: [Math.max(0, end - height), end],
    };
  });
}

const inkOf = (names, name, alpha = 1) => colour(SERIES[names.indexOf(name) % SERIES.length], alpha);

function signalFigure({ time_s: x, channels }, names) {
  const layout = { xaxis: axis("Time [s]") };
  const data = panels(channels, names).flatMap((panel, k, all) => {
    layout[panel.layoutKey] = axis(`[${panel.title}]`, { domain: panel.domain });
    if (k === all.length - 1) layout.xaxis.anchor = panel.yaxis;
    return panel.names.flatMap((name) => {
      const times = (values) => values.map((v) => (v === null ? null : v * panel.times));
      const common = {
        x,
        mode: "lines",
        type: "scatter",
        line: { color: inkOf(names, name), width: 0.8 },
        yaxis: panel.yaxis,
        hoverinfo: "skip",
      };
      return [
        { ...common, y: times(channels[name].low) },
        { ...common, y: times(channels[name].high), fill: "tonexty", fillcolor: inkOf(names, name, 0.4) },
      ];
    });
  });
  return { data, layout };
}

function spectrumFigure({ frequency_hz: x, channels, harmonics_hz: harmonics }, names) {
  const line = { color: colour("soft", 0.45), width: 1, dash: "dot" };
  const shapes = harmonics.slice(0, 400).map((f) => ({ type: "line", x0: f, x1: f, y0: 0, y1: 1, yref: "paper", line, layer: "below" }));
  const last = harmonics.at(-1);
  const layout = {
    hovermode: "x unified",
    shapes,
    xaxis: axis("Frequency [Hz]", {
      tickformat: ",d",
      range: last ? [0, Math.min(x.at(-1), last * 1.1)] : undefined,
      showgrid: false,
      unifiedhovertitle: { text: "%{x:,.1f} Hz" },
    }),
  };
  const data = panels(channels, names).flatMap((panel, k, all) => {
    layout[panel.layoutKey] = decades(`[${panel.title}]`, { domain: panel.domain });
    if (k === all.length - 1) layout.xaxis.anchor = panel.yaxis;
    return panel.names.map((name) => ({
      x,
      y: channels[name].amplitude.map((v) => v * panel.times),
      name: safe(name),
      mode: "lines",
      type: "scatter",
      line: { color: inkOf(names, name), width: 1.2 },
      yaxis: panel.yaxis,
      hovertemplate: `${safe(name)} %{y:.3~g} ${safe(panel.title)}<extra></extra>`,
    }));
  });
  return { data, layout, say: `Spectrum with ${harmonics.length} multiples of the spindle's frequency marked.` };
}
