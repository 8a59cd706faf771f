// What the charts of a running identification show.
import { axis, colour, safe } from "../charts.js";
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

/** Misfit over seconds: every try as a point, the best so far of each stage as a line. */
export function costFigure(trace) {
  const data = [];
  const annotations = [];
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
      const length = points.at(-1).seconds - points[0].seconds;
      if (length > 1.5 || stage === "search") {
        annotations.push({
          x: points[0].seconds,
          y: 1,
          yref: "paper",
          yanchor: "bottom",
          xanchor: "left",
          yshift: name === "Y" ? 0 : 15,
          text: safe(`${name}: ${stage}`),
          showarrow: false,
          font: { size: 11, color: ink },
        });
      }
    }
  }
  return {
    data,
    layout: {
      hovermode: "closest",
      annotations,
      margin: { l: 56, r: 14, t: 40, b: 44 },
      xaxis: axis("Time [s]", { rangemode: "tozero" }),
      yaxis: axis("Misfit", { type: "log", exponentformat: "e", dtick: 1 }),
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
