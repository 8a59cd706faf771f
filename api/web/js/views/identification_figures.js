// What the charts of a running identification show.
import { axis, colour, safe, SERIES } from "../charts.js";
import { factor, unit } from "../units.js";

const ORDER = ["X", "Y"];
const inkOf = (name, alpha = 1) => colour(SERIES[Math.max(0, ORDER.indexOf(name))], alpha);

/** Cost over seconds, an axis each; where a stage ends the line is marked. */
export function costFigure(trace) {
  const data = [];
  for (const [name, points] of trace) {
    const ink = inkOf(name);
    data.push({
      x: points.map((p) => p.seconds), y: points.map((p) => p.cost), name, text: points.map((p) => safe(p.stage)), type: "scatter", mode: "lines", line: { color: ink, width: 2, shape: "hv" },
      hovertemplate: `${name} %{y:.4~g}, %{text}<extra></extra>`,
    });
    const turns = points.filter((p, k) => k > 0 && p.stage !== points[k - 1].stage);
    data.push({ x: turns.map((p) => p.seconds), y: turns.map((p) => p.cost), text: turns.map((p) => p.stage), type: "scatter", mode: "markers", marker: { color: ink, size: 8, symbol: "line-ns-open" }, hoverinfo: "skip" });
  }
  return {
    data, layout: { hovermode: "closest", xaxis: axis("Time [s]", { rangemode: "tozero" }), yaxis: axis("Misfit", { type: "log", exponentformat: "e" }) },
    say: `Misfit over time: ${[...trace].map(([name, points]) => `${name} now ${points.at(-1)?.cost.toPrecision(3)}`).join(", ")}.`,
  };
}

/** Measured cross FRF as points, the model's through the very same frequencies. */
export function fitFigure(fits) {
  const data = [];
  const times = factor("receptance");
  for (const [name, fit] of fits) {
    data.push({
      x: fit.frequency_hz, y: fit.measured_abs.map((v) => v * times), name: `${name} measured`, type: "scatter", mode: "markers", marker: { color: inkOf(name, 0.5), size: 4.5 }, text: fit.tooling?.map(safe),
      hovertemplate: `${name} measured %{y:.3~g}${fit.tooling ? " (%{text})" : ""}<extra></extra>`,
    });
    // one line a tooling: the model of each is another
    for (const tooling of new Set(fit.tooling ?? [""])) {
      const which = fit.frequency_hz.map((_, k) => k).filter((k) => !fit.tooling || fit.tooling[k] === tooling).sort((a, b) => fit.frequency_hz[a] - fit.frequency_hz[b]);
      data.push({
        x: which.map((k) => fit.frequency_hz[k]), y: which.map((k) => fit.model_abs[k] * times), name: `${name} model`, type: "scatter",
        mode: fit.tooling ? "lines" : "markers", line: { color: inkOf(name), width: 1.8 }, marker: { color: inkOf(name), size: 4, symbol: "x-thin-open" },
        hovertemplate: `${name} model %{y:.3~g}${tooling ? ` (${safe(tooling)})` : ""}<extra></extra>`,
      });
    }
  }
  return {
    data, layout: { hovermode: "closest", xaxis: axis("Frequency [Hz]", { tickformat: ",d" }), yaxis: axis(`Cross receptance, flange over tip [${unit("receptance")}]`, { type: "log", exponentformat: "none", dtick: 1 }) },
    say: `Measured points and model, ${[...fits.keys()].join(" and ")}.`,
  };
}
