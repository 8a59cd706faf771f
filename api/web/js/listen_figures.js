// What the charts of a recording show: its signal, its spectrum over orders, its spectrogram with the tooth orders.
import { axis, colour, decades } from "./charts.js";
import { plain } from "./units.js";

/** Multiples that are drawn at most, and orders that are shown at first. */
const [MOST, ORDERS] = [60, 40];
/** Colours from quiet to loud, after viridis. */
const SCALE = [
  [68, 1, 84],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
];
const CHATTER = "#ff8c3b";

export function signalFigure(found) {
  const { unit, signal } = found.curves;
  const x = signal.low.map((_, i) => i * signal.step_s);
  const line = { color: colour("s1"), width: 0.8 };
  const common = { x, mode: "lines", type: "scatter", line, hoverinfo: "skip" };
  const [x0, x1] = found.part_s;
  const judged = { type: "rect", x0, x1, y0: 0, y1: 1, yref: "paper", fillcolor: colour("s3", 0.16), line: { width: 0 }, layer: "below" };
  return {
    data: [
      { ...common, y: signal.low },
      { ...common, y: signal.high, fill: "tonexty", fillcolor: colour("s1", 0.4) },
    ],
    layout: { shapes: [judged], xaxis: axis("Time [s]"), yaxis: axis(`Signal [${unit}]`, { exponentformat: "e", nticks: 5 }) },
  };
}

export function orderFigure(found) {
  const { unit, spectrum } = found.curves;
  const spindle = found.spindle_speed_rpm === null ? null : found.spindle_speed_rpm / 60;
  const x = spindle === null ? spectrum.frequency_hz : spectrum.frequency_hz.map((f) => f / spindle);
  const told = spectrum.frequency_hz.map((f, i) => (spindle === null ? `${plain(f, 1)} Hz` : `order ${plain(x[i], 2)} · ${plain(f, 1)} Hz`));
  const vertical = (at, line) => ({ type: "line", x0: at, x1: at, y0: 0, y1: 1, yref: "paper", line, layer: "below" });
  const shapes = [];
  const last = x.at(-1) ?? 0;
  if (spindle !== null) {
    const step = found.teeth ?? 1;
    for (let order = step; order <= last && shapes.length < MOST; order += step)
      shapes.push(vertical(order, { color: colour("s1", 0.55), width: 1, dash: "dot" }));
  }
  for (const f of found.chatter_frequencies_hz) shapes.push(vertical(spindle === null ? f : f / spindle, { color: colour("s2"), width: 2 }));
  const top = Math.max(...spectrum.amplitude);
  return {
    data: [
      {
        x,
        y: spectrum.amplitude,
        text: told,
        mode: "lines",
        type: "scatter",
        line: { color: colour("ink"), width: 1 },
        hovertemplate: `%{text} · %{y:.3~g} ${unit}<extra></extra>`,
      },
    ],
    layout: {
      shapes,
      xaxis: axis(spindle === null ? "Frequency [Hz]" : `Order of the spindle, ${plain(spindle, 2, 2)} Hz`, { showgrid: false, range: [0, spindle === null ? last : Math.min(last, Math.max(ORDERS, (1.15 * (found.chatter_frequencies_hz[0] ?? 0)) / spindle))] }),
      yaxis: decades(`Amplitude [${unit}]`, { range: top > 0 ? [Math.log10(top) - 4, Math.log10(top) + 0.2] : undefined }),
    },
  };
}

export function spectrogramFigure(found) {
  const { spectrogram } = found.curves;
  const [duration, highest] = [spectrogram.duration_s, spectrogram.highest_hz];
  const picture = { source: drawn(spectrogram.level_db), xref: "x", yref: "y", x: 0, y: 0, sizex: duration, sizey: highest, xanchor: "left", yanchor: "bottom", sizing: "stretch", layer: "below" };
  const shapes = [];
  if (found.spindle_speed_rpm !== null) {
    const [from, until] = (found.ramp ?? [found.spindle_speed_rpm, found.spindle_speed_rpm]).map((rpm) => (rpm / 60) * (found.teeth ?? 1));
    // many of them would hide what they mark
    const alpha = highest / Math.max(from, until) > 15 ? 0.3 : 0.75;
    const line = { color: `rgba(255,255,255,${alpha})`, width: 1, dash: "dot" };
    for (let m = 1; m * Math.max(from, until) <= highest && m <= MOST; m += 1)
      shapes.push({ type: "line", x0: found.part_s[0], x1: found.part_s[1], y0: m * from, y1: m * until, line });
  }
  for (const f of found.chatter_frequencies_hz) shapes.push({ type: "line", x0: 0, x1: duration, y0: f, y1: f, line: { color: CHATTER, width: 2 } });
  return {
    // a chart without a line has no axes
    data: [{ x: [0, duration], y: [0, highest], mode: "markers", type: "scatter", marker: { opacity: 0 }, hoverinfo: "skip" }],
    layout: {
      images: [picture],
      shapes,
      xaxis: axis("Time [s]", { range: [0, duration], showgrid: false, zeroline: false }),
      yaxis: axis("Frequency [Hz]", { range: [0, highest], tickformat: ",d", showgrid: false, zeroline: false }),
    },
  };
}

/** The levels as a picture, a point for each; quiet below. */
function drawn(levels) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [levels[0].length, levels.length];
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(canvas.width, canvas.height);
  levels.forEach((row, r) =>
    row.forEach((level, c) => {
      const place = 4 * ((canvas.height - 1 - r) * canvas.width + c);
      const share = (Math.min(1, Math.max(0, 1 + level / 60)) * (SCALE.length - 1));
      const k = Math.min(Math.floor(share), SCALE.length - 2);
      for (let i = 0; i < 3; i += 1) image.data[place + i] = SCALE[k][i] + (share - k) * (SCALE[k + 1][i] - SCALE[k][i]);
      image.data[place + 3] = 255;
    }),
  );
  pen.putImageData(image, 0, 0);
  return canvas.toDataURL();
}
