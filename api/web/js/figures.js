// What the charts of a tool change show: lobes with bands, tooltip FRFs with bands.
import { axis, colour, DASHES, safe, SERIES } from "./charts.js";
import { apart } from "./labels.js";
import { MARKS } from "./tested.js";
import { factor, plain, text, unit } from "./units.js";

const seriesOf = (i) => SERIES[i % SERIES.length];

/** Where the lobes begin above the chatter frequencies, as a share of the chart's height. */
const UPPER = 0.33;

/** Radial depth of a cut [mm]. */
export const widthOf = (cut, diameter) => (cut.stock === "block" ? Math.min(cut.y_to_mm - cut.y_from_mm, diameter) : cut.immersion * diameter);

/** Material removed per depth and speed [cm^3/min per mm and rev/min]. */
export function removalPer(tooling, cut, feed) {
  return (widthOf(cut, tooling.diameter_mm) * tooling.teeth * feed) / 1000;
}

/**
 * Lobes of several toolings above, and below the frequency at which each would chatter.
 * `parts` are limits of another method, as far as they are known: the lobes themselves are then a preview, drawn as such.
 * `box` is what it is drawn in.
 */
export function lobeFigure(lobes, { maxDepth, removal, recommended = [], around = [], tested = [], parts = null }, box) {
  const times = factor("depth");
  const data = [];
  const tops = [];
  let highest = 0;
  lobes.forEach((each, i) => {
    const name = seriesOf(i);
    const ink = colour(name);
    const x = each.spindle_speed_rpm;
    const preview = parts !== null || each.method === "zero-order";
    // null is stable up to the depth that was asked for: drawn at that depth
    const shown = (values) => values.map((v) => (v ?? maxDepth) * times);
    const y = shown(each.limit_depth_mm);
    highest = Math.max(highest, ...y);
    const band = (limits) => {
      if (!limits.limit_depth_low_mm) return;
      const common = { x: limits.spindle_speed_rpm, mode: "lines", line: { width: 0 }, hoverinfo: "skip", type: "scatter" };
      data.push({ ...common, y: shown(limits.limit_depth_low_mm) });
      data.push({ ...common, y: shown(limits.limit_depth_high_mm), fill: "tonexty", fillcolor: colour(name, 0.28) });
      highest = Math.max(highest, ...shown(limits.limit_depth_high_mm).map((v) => Math.min(v, maxDepth * times)));
    };
    if (!parts) band(each);
    const told = x.map((rpm, k) => {
      const depth = each.limit_depth_mm[k];
      const low = each.limit_depth_low_mm?.[k] ?? null;
      const sure = each.limit_depth_low_mm && low !== null ? ` (95 %: ${text("depth", low)})` : "";
      const by = preview ? "preview: " : "";
      const limit = depth === null ? `${by}limit above ${text("depth", maxDepth)}` : `${by}limit ${text("depth", depth)}${sure}`;
      const deep = each.recommended_depth_mm[k];
      const rate = removal[i] && deep !== null ? ` · ${text("removal", removal[i] * rpm * deep)}` : "";
      const chatter = each.chatter_frequency_hz[k];
      const advised = deep === null ? "" : ` · recommended ${text("depth", deep)}`;
      return `${limit}${advised}${rate}${chatter === null ? "" : ` · ${plain(chatter)} Hz`}`;
    });
    data.push({
      x,
      y,
      name: safe(each.tooling),
      text: told,
      type: "scatter",
      mode: "lines",
      line: preview ? { color: ink, width: 1.2, dash: "dot" } : { color: ink, width: 2.2, dash: DASHES[Math.floor(i / SERIES.length)] },
      fill: lobes.length === 1 && !preview ? "tozeroy" : "none",
      fillcolor: colour(name, 0.07),
      hovertemplate: lobes.length === 1 ? "%{text}<extra></extra>" : "%{text}",
    });
    data.push({
      x,
      y: each.chatter_frequency_hz,
      name: safe(each.tooling),
      yaxis: "y2",
      type: "scatter",
      mode: "markers",
      marker: { color: ink, size: 3.2 },
      hoverinfo: "skip",
    });
    const part = parts?.[i];
    if (part) {
      const common = { x: part.spindle_speed_rpm, type: "scatter", hoverinfo: "skip" };
      const line = { color: ink, width: 2.2 };
      data.push({ ...common, y: shown(part.limit_depth_mm), mode: "lines+markers", line, marker: { color: ink, size: 5 } });
      highest = Math.max(highest, ...shown(part.limit_depth_mm));
    }
    for (const limits of parts ? [] : (around[i] ?? [])) {
      // beside lobes of a method of their own they would be drawn twice
      if (!preview) continue;
      band(limits);
      const y = shown(limits.limit_depth_mm);
      highest = Math.max(highest, ...y);
      data.push({ x: limits.spindle_speed_rpm, y, type: "scatter", mode: "lines", line: { color: ink, width: 2.6 }, hoverinfo: "skip" });
    }
    const best = preview ? [] : each.best_speeds.slice(0, lobes.length > 3 ? 1 : 3);
    data.push({
      x: best.map((b) => b.spindle_speed_rpm),
      y: best.map((b) => (b.limit_depth_mm ?? maxDepth) * times),
      type: "scatter",
      mode: "markers",
      marker: { color: colour("paper"), size: 10, symbol: "diamond", line: { color: ink, width: 2.4 } },
      hoverinfo: "skip",
    });
    const cut = recommended[i];
    if (cut && cut.recommended_depth_mm !== null) {
      data.push({
        x: [cut.spindle_speed_rpm],
        y: [cut.recommended_depth_mm * times],
        type: "scatter",
        mode: "markers",
        marker: { color: ink, size: 11, symbol: "circle", line: { color: colour("paper"), width: 1.5 } },
        hoverinfo: "skip",
      });
    }
    if (preview && cut) tops.push({ rpm: cut.spindle_speed_rpm, depth: (cut.limit_depth_mm ?? maxDepth) * times, ink, k: 0 });
    best.forEach((b, k) => tops.push({ rpm: b.spindle_speed_rpm, depth: (b.limit_depth_mm ?? maxDepth) * times, ink, k }));
  });
  for (const [verdict, [symbol, , ink]] of Object.entries(MARKS)) {
    const cuts = tested.filter((cut) => cut.verdict === verdict);
    if (!cuts.length) continue;
    data.push({
      x: cuts.map((cut) => cut.spindle_speed_rpm),
      y: cuts.map((cut) => cut.axial_depth_mm * times),
      type: "scatter",
      mode: "markers",
      marker: { color: colour(ink), size: 9, symbol, line: { color: colour(ink), width: 2 } },
      hoverinfo: "skip",
    });
  }
  const deepest = Math.max(0, ...tested.map((cut) => cut.axial_depth_mm * times));
  const top = Math.max(Math.min(highest * 1.16, maxDepth * times * 1.1), deepest * 1.08) || 1;
  const speeds = lobes[0].spindle_speed_rpm;
  const layout = {
    hovermode: "x unified",
    annotations: labelled(tops, speeds, top, box),
    // what somebody has drawn near stays near while limits come
    uirevision: "lobes",
    xaxis: axis("Spindle speed [rev/min]", {
      anchor: "y2",
      ...(parts && speeds.length > 1 ? { range: [speeds[0], speeds.at(-1)] } : {}),
      tickformat: ",d",
      hoverformat: ",.0f",
      unifiedhovertitle: { text: "%{x:,.0f} rev/min" },
    }),
    yaxis: axis(`Axial depth [${unit("depth")}]`, { domain: [UPPER, 1], range: [0, top], fixedrange: false }),
    yaxis2: axis("Chatter [Hz]", { domain: [0, 0.25], rangemode: "normal", nticks: 4 }),
  };
  const words = lobes.map((l, i) => {
    const best = l.method === "zero-order" ? recommended[i] : l.best_speeds[0];
    return best
      ? `${l.tooling}: stability limit at ${plain(best.spindle_speed_rpm)} rev/min, ${text("depth", best.limit_depth_mm ?? maxDepth)}`
      : l.tooling;
  });
  return { data, layout, say: `Stability lobes. ${words.join("; ")}.` };
}

/** The speeds of pockets' tops, none of which covers another: the highest of each tooling first. */
function labelled(tops, speeds, top, box) {
  // what axes and margins leave of it
  const [width, height] = [box.clientWidth - 70, (1 - UPPER) * (box.clientHeight - 56)];
  const scale = width / (speeds.at(-1) - speeds[0] || 1);
  const labels = tops
    .toSorted((a, b) => a.k - b.k || b.depth - a.depth)
    .map((each) => {
      const place = { x: (each.rpm - speeds[0]) * scale, y: (each.depth / top) * height };
      return { ...each, ...place, size: each.k === 0 ? 15 : 12, text: plain(each.rpm) };
    });
  return apart(labels, 14).map(({ rpm, depth, ink, k, size, text: words, shift }) => ({
    x: rpm,
    y: depth,
    text: words,
    showarrow: false,
    // the highest one is written larger: it keeps off its diamond
    yshift: k === 0 ? shift + 3 : shift,
    font: { color: ink, size, weight: k === 0 ? 700 : 400 },
    bgcolor: colour("paper", 0.75),
    borderpad: 1,
  }));
}

const PARTS = {
  magnitude: { of: (re, im) => Math.hypot(re, im), spread: (re, im, a, b) => Math.hypot(re * a, im * b) / (Math.hypot(re, im) || 1) },
  phase: { of: (re, im) => (Math.atan2(im, re) * 180) / Math.PI, spread: () => 0 },
  real: { of: (re) => re, spread: (re, im, a) => a },
  imaginary: { of: (re, im) => im, spread: (re, im, a, b) => b },
};

function wrapped(curve, part) {
  const { of, spread } = PARTS[part];
  const y = curve.re.map((re, k) => of(re, curve.im[k]));
  const band =
    part !== "phase" && curve.re_std ? curve.re.map((re, k) => 1.96 * spread(re, curve.im[k], curve.re_std[k], curve.im_std[k])) : null;
  return { y, band };
}

/** Share of the largest value below which curves across the directions are cut off. */
const LEAST_ACROSS = 3e-4;

/** What is felt across: XY is the motion in X under a force in Y; one curve where both ways are the same. */
export function across(answer) {
  const { XY, YX } = answer.cross ?? {};
  if (!XY || !YX) return Object.entries(answer.cross ?? {});
  const most = Math.max(...XY.re.map((re, k) => Math.hypot(re, XY.im[k])));
  const apart = Math.max(...XY.re.map((re, k) => Math.hypot(re - YX.re[k], XY.im[k] - YX.im[k])));
  return apart <= 1e-6 * most ? [["XY = YX", XY]] : [["XY", XY], ["YX", YX]];
}

/** The curves that are asked for, each with its place among all. */
function curves(answer, shown, one) {
  const direct = Object.entries(answer.axes).map(([name, curve], k) => ({ name, curve, k, dash: "solid" }));
  const cross = across(answer).map(([name, curve], k) => ({ name, curve, k: direct.length + k, dash: "dash" }));
  if (shown === "across") return cross;
  return shown === "both" ? [...direct, ...(one ? cross : [])] : direct.filter((each) => each.name === shown);
}

/** FRFs: answers of /tooltip or of a machine's flange, as [{name, frequency_hz, axes}]. */
export function frfFigure(answers, { parts, shown }) {
  const data = [];
  const times = factor("receptance");
  const log = parts === "polar";
  const [upper, lower] = log ? ["magnitude", "phase"] : ["real", "imaginary"];
  answers.forEach((answer, i) => {
    curves(answer, shown, answers.length === 1).forEach(({ name, curve, k, dash: own }) => {
      const series = answers.length === 1 ? seriesOf(k) : seriesOf(i);
      const dash = answers.length === 1 ? own : DASHES[k];
      const label = safe(answers.length === 1 ? name : `${answer.tooling} ${name}`);
      for (const [part, yaxis] of [
        [upper, "y"],
        [lower, "y2"],
      ]) {
        const { y, band } = wrapped(curve, part);
        const scale = part === "phase" ? 1 : times;
        const x = answer.frequency_hz;
        if (band) {
          const common = { x, yaxis, mode: "lines", line: { width: 0 }, hoverinfo: "skip", type: "scatter" };
          // a logarithm has no room for what may be nothing
          const least = part === "magnitude" ? 0.02 : -Infinity;
          data.push({ ...common, y: y.map((v, j) => Math.max(v - band[j], least * Math.abs(v)) * scale) });
          data.push({ ...common, y: y.map((v, j) => (v + band[j]) * scale), fill: "tonexty", fillcolor: colour(series, 0.22) });
        }
        const shownUnit = part === "phase" ? "°" : ` ${unit("receptance")}`;
        data.push({
          x,
          y: y.map((v) => v * scale),
          yaxis,
          name: label,
          type: "scatter",
          mode: "lines",
          line: { color: colour(series), width: 1.8, dash },
          hovertemplate: `${label} %{y:.4~g}${shownUnit}<extra></extra>`,
        });
      }
    });
  });
  // what is felt across passes through zero: its depth there is nobody's question
  const crossed = answers.some((answer) => across(answer).length) && shown !== "across";
  const sizes = answers.flatMap((answer) => Object.values(answer.axes).flatMap((c) => c.re.map((re, k) => Math.hypot(re, c.im[k]) * times)));
  const most = crossed ? sizes.reduce((a, b) => Math.max(a, b), 0) : 0;
  const u = unit("receptance");
  const layout = {
    hovermode: "x unified",
    xaxis: axis("Frequency [Hz]", { anchor: "y2", tickformat: ",d", unifiedhovertitle: { text: "%{x:,.0f} Hz" } }),
    yaxis: axis(log ? `Magnitude [${u}]` : `Real [${u}]`, {
      domain: [log ? 0.38 : 0.53, 1],
      type: log ? "log" : "linear",
      dtick: log ? 1 : undefined,
      ...(log && most > 0 ? { range: [Math.log10(LEAST_ACROSS * most), Math.log10(2 * most)] } : {}),
      exponentformat: "none",
    }),
    yaxis2: axis(log ? "Phase [°]" : `Imag. [${u}]`, {
      domain: [0, log ? 0.3 : 0.46],
      ...(log ? { tickvals: [-180, -90, 0, 90, 180], range: [-190, 190] } : {}),
    }),
  };
  return {
    data,
    layout,
    say: `Frequency response of ${answers.map((a) => a.tooling).join(", ")}, ${log ? "magnitude and phase" : "real and imaginary part"}.`,
  };
}
