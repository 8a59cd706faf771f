// Forces of a recording: over time, in numbers, and line by line.
import { card, fill, h, note, sentence, table } from "../dom.js";
import { axis, chart, colour, legend, safe, SERIES } from "../charts.js";
import { busy, failed } from "../forms.js";
import { factor, plain, q, significant, unit } from "../units.js";

/** The start of a recording or a stream that has no forces. */
export const leftOut = (seconds) => `The first ${plain(seconds, 2, 2)} s are left out: the observer settles in them.`;

export function forceResults(place, found, name, download) {
  const axes = Object.keys(found.axes);
  const keys = legend(axes.map((a, k) => ({ name: `F${a.toLowerCase()}`, series: SERIES[k] })));
  const time = chart(`Forces of ${name} over time`);
  const lines = chart("Harmonics of the force", "small tall");
  const fault = h("div");
  const csv = h("button", { type: "button", class: "quiet" }, "FORCES.csv");
  csv.addEventListener(
    "click",
    busy(csv, () => download().catch((error) => failed(fault, error))),
  );
  fill(
    place,
    found.notes.length ? note("doubt", ...found.notes.map(sentence)) : null,
    fault,
    card(
      `Forces of ${name}`,
      csv,
      h("p", { class: "soft" }, `${plain(found.spindle_speed_rpm, 1)} rev/min; forces up to ${plain(found.band_hz[1])} Hz. ${leftOut(found.left_out_s)}`),
      keys,
      time,
    ),
    h(
      "div",
      { class: "split" },
      card(
        "In numbers",
        null,
        table(
          "Forces in numbers",
          [
            { name: "Axis", cell: (a) => a },
            {
              name: "Mean",
              number: true,
              cell: (a) => (found.axes[a].mean_n === null ? h("span", { class: "soft" }, "not seen") : q("force", found.axes[a].mean_n)),
            },
            { name: "RMS", number: true, cell: (a) => q("force", found.axes[a].rms_n) },
            { name: "Peak", number: true, cell: (a) => q("force", found.axes[a].peak_n) },
            { name: "± of a sample", number: true, cell: (a) => q("force", found.axes[a].std_n) },
          ],
          axes,
        ),
        wear(found.wear),
      ),
      card("Harmonics", null, keys.cloneNode(true), lines),
    ),
  );
  time.draw(() => timeFigure(found, axes));
  lines.draw(() => linesFigure(found));
}

function timeFigure(found, axes) {
  const times = factor("force");
  const data = axes.flatMap((name, k) => {
    const ink = SERIES[k];
    const common = { x: found.time_s, type: "scatter", mode: "lines", line: { color: colour(ink), width: 0.8 }, hoverinfo: "skip" };
    return [
      { ...common, y: found.axes[name].low.map((v) => v * times) },
      { ...common, y: found.axes[name].high.map((v) => v * times), fill: "tonexty", fillcolor: colour(ink, 0.4) },
    ];
  });
  return {
    data,
    layout: { xaxis: axis("Time [s]"), yaxis: axis(`Force [${unit("force")}]`) },
    say: `Forces over time, ${axes.join(" and ")}.`,
  };
}

function linesFigure(found) {
  const times = factor("force");
  const data = Object.entries(found.harmonics).map(([name, rows], k) => ({
    x: rows.map((r) => r.order),
    y: rows.map((r) => r.amplitude_n * times),
    text: rows.map((r) => `${plain(r.frequency_hz)} Hz`),
    type: "bar",
    textposition: "none",
    marker: { color: colour(SERIES[k]) },
    name: safe(name),
    hovertemplate: `F${name.toLowerCase()} %{y:.3~g} ${unit("force")}, %{text}<extra></extra>`,
  }));
  return {
    data,
    layout: {
      barmode: "group",
      xaxis: axis("Multiple of the spindle's frequency"),
      yaxis: axis(`Amplitude [${unit("force")}]`, { rangemode: "tozero" }),
    },
  };
}

function wear(found) {
  if (!found) return null;
  return table(
    "Cutting coefficients",
    [
      { name: "Coefficient", cell: ([name]) => name.replaceAll("_", " ") },
      { name: "Mean", number: true, cell: ([, c]) => `${significant(c.mean, 4)} ± ${significant(c.std, 2)} ${c.unit}` },
      {
        name: "Trend per second",
        number: true,
        cell: ([, c]) => `${significant(c.trend_per_s, 3)} ± ${significant(c.trend_std_per_s, 2)}`,
      },
    ],
    Object.entries(found.coefficients),
  );
}
