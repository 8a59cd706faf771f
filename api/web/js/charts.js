// Plotly: loaded when a first chart is wanted, drawn in the colours of the page.
import { h, waiting, fill } from "./dom.js";

let loading = null;

function script(file) {
  const address = new URL(`../vendor/${file}`, import.meta.url).href;
  return new Promise((resolve, reject) => {
    document.head.append(h("script", { src: address, onload: resolve, onerror: () => reject(new Error(`${file} does not come`)) }));
  });
}

/** Plotly itself. */
export function plotly() {
  loading ??= script("plotly/plotly-basic.min.js").then(() => window.Plotly);
  return loading;
}

let streaming = null;
/** uPlot itself. */
export function uplot() {
  streaming ??= script("uplot/uPlot.iife.min.js").then(() => window.uPlot);
  return streaming;
}

let unpacking = null;
/** zip.js itself. */
export function zipjs() {
  unpacking ??= script("zip/zip-core.min.js").then(() => window.zip);
  return unpacking;
}

/** The value of a colour of the page, as it is now. */
export function colour(name, alpha = 1) {
  const probe = h("span", { hidden: true });
  probe.style.color = `var(--${name})`;
  document.body.append(probe);
  const [r, g, b] = getComputedStyle(probe).color.match(/[\d.]+/g);
  probe.remove();
  return `rgba(${r},${g},${b},${alpha})`;
}

export const SERIES = ["s1", "s2", "s3", "s4", "s5", "s6"];
export const DASHES = ["solid", "dash", "dot", "dashdot"];

/** A name as text: Plotly reads some tags in what it writes. */
export const safe = (name) => String(name).replaceAll("&", "&amp;").replaceAll("<", "&lt;");

/** Everything that all axes share. */
export function axis(title, more = {}) {
  const line = colour("line");
  return {
    title: { text: title, standoff: 8 },
    gridcolor: line,
    linecolor: colour("strong-line"),
    zerolinecolor: line,
    ticks: "outside",
    tickcolor: line,
    automargin: true,
    ...more,
  };
}

const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const DECADES = Array.from({ length: 41 }, (_, k) => k - 24);

/** A logarithmic axis with a tick at each decade; Plotly's own powers are styled inline, which the page forbids. */
export const decades = (title, more = {}) =>
  axis(title, {
    type: "log",
    tickvals: DECADES.map((k) => 10 ** k),
    ticktext: DECADES.map((k) => `10${[...String(k)].map((each) => RAISED[each]).join("")}`),
    ...more,
  });

function layoutOf(given) {
  const root = Number.parseFloat(getComputedStyle(document.documentElement).fontSize);
  return {
    font: { family: "system-ui, sans-serif", size: Math.round(root * 0.82), color: colour("ink") },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 56, r: 14, t: 12, b: 44 },
    showlegend: false,
    separators: ".\u202f",
    hoverlabel: {
      bgcolor: colour("raised"),
      bordercolor: colour("strong-line"),
      font: { color: colour("ink"), size: Math.round(root * 0.82) },
    },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("strong-line"), activecolor: colour("accent") },
    dragmode: "zoom",
    ...given,
  };
}

/**
 * A chart of Plotly: `figure(plot)` returns {data, layout}, and is asked again when light turns to dark or millimetres to inches.
 * `say` is what it shows, in words, for those who do not see it; `before` stands there until there is something to draw.
 */
export function chart(say, kind = "", before = "drawing …") {
  // the picture itself says nothing to those who hear the page, and its buttons are no part of what is said of it
  const words = h("span", { class: "unseen", role: "img", "aria-label": say });
  const plot = h("div", { class: "plot" }, waiting(before));
  const box = h("div", { class: `chart ${kind}`.trim() }, words, plot);
  let make = null;
  let drawn = false;
  let width = 0;
  let observer = null;
  async function draw() {
    if (!make) return;
    const Plotly = await plotly();
    if (!box.isConnected) return;
    const { data, layout, say: now } = make(plot);
    width = plot.clientWidth;
    if (now) words.setAttribute("aria-label", now);
    if (!drawn) fill(plot);
    drawn = true;
    const buttons = ["select2d", "lasso2d", "autoScale2d", "toggleSpikelines", "hoverClosestCartesian", "hoverCompareCartesian"];
    await Plotly.react(plot, data, layoutOf(layout), {
      displaylogo: false,
      modeBarButtonsToRemove: buttons,
      displayModeBar: "hover",
      responsive: false,
      toImageButtonOptions: { format: "svg", filename: "rcsa-ident" },
    });
    for (const drawing of plot.querySelectorAll("svg.main-svg")) drawing.setAttribute("aria-hidden", "true");
    if (!observer) {
      observer = new ResizeObserver(() => {
        if (!box.isConnected || !plot.clientWidth) return;
        Plotly.Plots.resize(plot);
        // where labels find a place has changed
        if (Math.abs(plot.clientWidth - width) > 0.1 * width) draw();
      });
      observer.observe(box);
    }
  }
  const again = () => (box.isConnected ? draw() : stop());
  function stop() {
    window.removeEventListener("theme", again);
    window.removeEventListener("units", again);
    observer?.disconnect();
  }
  window.addEventListener("theme", again);
  window.addEventListener("units", again);
  box.draw = (figure) => {
    make = figure;
    return draw();
  };
  box.stop = stop;
  return box;
}

/** A legend of one's own: it wraps on a phone, and is read out. */
export function legend(entries) {
  return h(
    "ul",
    { class: "legend" },
    entries.map(({ name, series, dash = "solid", kind = "line" }) =>
      h("li", null, h("span", { class: `key ${kind} ${series} ${dash}`, "aria-hidden": "true" }), name),
    ),
  );
}
