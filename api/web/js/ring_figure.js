// The spectrum of what rings, with the modes that were heard in it.
import { axis, colour, decades } from "./charts.js";
import { plain } from "./units.js";

/** How far beyond the last line is shown. */
const BEYOND = 1.3;

export function ringFigure(curve, heard) {
  const vertical = (at, name, dash, width) => ({ type: "line", x0: at, x1: at, y0: 0, y1: 1, yref: "paper", layer: "below", line: { color: colour(name), width, dash } });
  const shapes = heard.flatMap((line) => [
    vertical(line.frequency_hz, line.is ? "s2" : "s6", line.is ? "solid" : "dot", 2),
    ...(line.drawn_hz ? [vertical(line.drawn_hz, "s3", "dash", 1.5)] : []),
  ]);
  const annotations = heard
    .filter((line) => line.is)
    .map((line) => ({ x: line.frequency_hz, y: 1, yref: "paper", yanchor: "bottom", text: line.is, showarrow: false, font: { color: colour("ink") } }));
  const last = curve.frequency_hz.at(-1) ?? 0;
  const least = curve.amplitude.reduce((low, value) => (value > 0 ? Math.min(low, value) : low), 1);
  return {
    data: [
      {
        x: curve.frequency_hz,
        y: curve.amplitude,
        text: curve.frequency_hz.map((f) => `${plain(f, 1)} Hz`),
        mode: "lines",
        type: "scatter",
        line: { color: colour("ink"), width: 1 },
        hovertemplate: "%{text}<extra></extra>",
      },
    ],
    layout: {
      shapes,
      annotations,
      margin: { l: 56, r: 14, t: 26, b: 44 },
      xaxis: axis("Frequency [Hz]", { tickformat: ",d", showgrid: false, range: [0, Math.min(last, BEYOND * Math.max(...heard.map((line) => line.frequency_hz), last / 4))] }),
      yaxis: decades("Amplitude [of the loudest]", { range: [Math.log10(least) - 0.2, 0.2] }),
    },
  };
}
