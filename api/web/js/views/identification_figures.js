// What the charts of a running identification show.
import { axis, colour, decades, safe } from "../charts.js";
import { factor, unit } from "../units.js";

const INKS = { X: "s1", Y: "s2", both: "s3" };
const inkOf = (name, alpha = 1) => colour(INKS[name] ?? "s4", alpha);

/** Runs of one stage each: their costs are of different kinds, and are not joined. */
function stagesOf(points) {
  const found = [];
  for (const point of points) {
    if (found.at(-1)?.stage !== point.stage) found.push({ stage: point.stage, points: [] });
    found.at(-1).points.push(point);
  }
  return found;
}

/** Rows of stage labels above the chart, their height, and the width of a letter in them [px]. */
const ROWS = 3;
const ROW = 15;
const LETTER = 6.6;

/** Labels beside each other, in as many rows as there are; one that finds no room is left to the tips over the points. */
function placed(labels, width, longest) {
  const pixels = Math.max(width - 80, 100) / Math.max(longest, 1e-9);
  const ends = Array(ROWS).fill(-Infinity);
  return labels
    .toSorted((a, b) => a.x - b.x)
    .flatMap((label) => {
      const from = label.x * pixels;
      const to = from + label.text.length * LETTER;
      const row = ends.findIndex((end) => end < from);
      if (row < 0 || to > longest * pixels + 60) return [];
      ends[row] = to;
      return [{ ...label, yshift: row * ROW }];
    });
}

/** Misfit over seconds: every try as a point, the best so far of each stage as a line; `width` is the chart's [px]. */
export function costFigure(trace, width) {
  const data = [];
  const labels = [];
  let longest = 0;
  for (const [name, all] of trace) {
    const ink = inkOf(name);
    for (const { stage, points } of stagesOf(all)) {
      // a stage that counts otherwise, below nothing too, has no place on this scale
      const shown = points.filter((p) => p.cost > 0);
      const common = {
        x: shown.map((p) => p.seconds),
        name,
        type: "scatter",
        hovertemplate: `${safe(name)}, ${safe(stage)} %{y:.4~g}<extra></extra>`,
      };
      let best = Infinity;
      const lowest = shown.map((p) => (best = Math.min(best, p.cost)));
      data.push({ ...common, y: shown.map((p) => p.cost), mode: "markers", marker: { color: inkOf(name, 0.45), size: 5 } });
      data.push({
        ...common,
        y: lowest,
        mode: "lines",
        line: { color: ink, width: 2.2, shape: "hv" },
        hoverinfo: "skip",
        hovertemplate: undefined,
      });
      longest = Math.max(longest, points.at(-1).seconds);
      const where = { x: points[0].seconds, y: 1, yref: "paper", yanchor: "bottom", xanchor: "left", showarrow: false };
      labels.push({ ...where, text: safe(`${name}: ${stage}`), font: { size: 11, color: ink } });
    }
  }
  return {
    data,
    layout: {
      hovermode: "closest",
      annotations: placed(labels, width, longest),
      margin: { l: 56, r: 14, t: ROWS * ROW + 8, b: 44 },
      xaxis: axis("Time [s]", { rangemode: "tozero" }),
      yaxis: decades("Misfit"),
    },
    say: `Misfit over time: ${[...trace].map(([name, points]) => `${name}, ${points.at(-1)?.stage}, ${points.at(-1)?.cost.toPrecision(3)}`).join("; ")}.`,
  };
}

/** Measured cross FRF as points, the model's through the very same frequencies. */
export function fitFigure(fits) {
  const data = [];
  const times = factor("receptance");
  for (const [name, fit] of fits) {
    data.push({
      x: fit.frequency_hz,
      y: fit.measured_abs.map((v) => v * times),
      name: `${name} measured`,
      type: "scatter",
      mode: "markers",
      marker: { color: inkOf(name, 0.5), size: 4.5 },
      text: fit.tooling?.map(safe),
      hovertemplate: `${name} measured %{y:.3~g}${fit.tooling ? " (%{text})" : ""}<extra></extra>`,
    });
    // one line a tooling: the model of each is another
    for (const tooling of new Set(fit.tooling ?? [""])) {
      const which = fit.frequency_hz
        .map((_, k) => k)
        .filter((k) => !fit.tooling || fit.tooling[k] === tooling)
        .sort((a, b) => fit.frequency_hz[a] - fit.frequency_hz[b]);
      data.push({
        x: which.map((k) => fit.frequency_hz[k]),
        y: which.map((k) => fit.model_abs[k] * times),
        name: `${name} model`,
        type: "scatter",
        mode: fit.tooling ? "lines" : "markers",
        line: { color: inkOf(name), width: 1.8 },
        marker: { color: inkOf(name), size: 4, symbol: "x-thin-open" },
        hovertemplate: `${name} model %{y:.3~g}${tooling ? ` (${safe(tooling)})` : ""}<extra></extra>`,
      });
    }
  }
  return {
    data,
    layout: {
      hovermode: "closest",
      xaxis: axis("Frequency [Hz]", { tickformat: ",d" }),
      yaxis: axis(`Cross receptance, flange over tip [${unit("receptance")}]`, { type: "log", exponentformat: "none", dtick: 1 }),
    },
    say: `Measured points and model, ${[...fits.keys()].join(" and ")}.`,
  };
}
