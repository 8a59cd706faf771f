// Forces as they come: least and largest of each moment, drawn sixty times a second.
import { colour, SERIES } from "./charts.js";
import { factor, unit } from "./units.js";

/** A chart of uPlot with bars from the least to the largest force of each bucket: outlines of so many points cost ten times as much. */
export function liveChart(uPlot, box, axes, data) {
  let plot = null;
  function make() {
    const line = colour("line");
    const words = {
      stroke: colour("ink"),
      grid: { stroke: line, width: 1 },
      ticks: { stroke: line, width: 1 },
      font: "13px system-ui, sans-serif",
      labelFont: "13px system-ui, sans-serif",
    };
    const inks = axes.map((_, k) => colour(SERIES[k], 0.85));
    const options = {
      width: box.clientWidth || 600,
      height: box.clientHeight || 320,
      legend: { show: false },
      cursor: { show: false },
      pxAlign: false,
      scales: { x: { time: false } },
      axes: [
        { ...words, label: "Time [s]" },
        { ...words, label: `Force [${unit("force")}]`, size: 64 },
      ],
      series: [
        {},
        ...axes.flatMap(() => [
          { paths: () => null, points: { show: false } },
          { paths: () => null, points: { show: false } },
        ]),
      ],
      hooks: { draw: [(u) => bars(u, inks, data().step)] },
    };
    plot?.destroy();
    box.replaceChildren();
    plot = new uPlot(options, data().columns(factor("force")), box);
  }
  make();
  const observer = new ResizeObserver(() => plot.setSize({ width: box.clientWidth, height: box.clientHeight }));
  observer.observe(box);
  return {
    // all at once: one picture a frame
    show: (columns, from, to) =>
      plot.batch(() => {
        plot.setData(columns, false);
        plot.setScale("x", { min: from, max: to });
        plot.setScale("y", reach(columns));
      }),
    repaint: make,
    destroy: () => {
      observer.disconnect();
      plot.destroy();
    },
  };
}

/** Bars of all axes, one for each column of the picture and long enough to touch the one before; the smaller force lies on top. */
function bars(plot, inks, step) {
  const { ctx, bbox, data } = plot;
  const place = (scale) => {
    const [from, to] = [plot.valToPos(0, scale, true), plot.valToPos(1, scale, true)];
    return (value) => Math.round(from + (to - from) * value);
  };
  const [x, y] = [place("x"), place("y")];
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  const all = inks.map((ink, k) => ({ ink, columns: columnsOf(data[0], data[1 + 2 * k], data[2 + 2 * k], step, x, y) }));
  const size = ({ columns }) => columns.reduce((sum, each) => sum + each.lower - each.upper, 0);
  for (const { ink, columns } of all.sort((a, b) => size(b) - size(a))) {
    ctx.fillStyle = ink;
    let before = null;
    for (const each of columns) {
      const joined = before && each.left <= before.right;
      const upper = joined ? Math.min(each.upper, before.lower) : each.upper;
      const lower = joined ? Math.max(each.lower, before.upper) : each.lower;
      ctx.fillRect(each.left, upper, each.right - each.left, Math.max(1, lower - upper));
      before = each;
    }
  }
  ctx.restore();
}

/** Buckets as columns of whole pixels; those that fall into one are one. */
function columnsOf(time, low, high, step, x, y) {
  const found = [];
  for (let i = 0; i < time.length; i += 1) {
    if (low[i] === null || Number.isNaN(low[i])) continue;
    const [left, upper, lower] = [x(time[i]), y(high[i]), y(low[i])];
    const last = found.at(-1);
    if (last?.left === left) {
      last.upper = Math.min(last.upper, upper);
      last.lower = Math.max(last.lower, lower);
    } else found.push({ left, right: Math.max(left + 1, x(time[i] + step)), upper, lower });
  }
  return found;
}

/** A range for all columns behind the first; a few moments do not set it. */
function reach(columns) {
  const values = Float64Array.from(
    columns
      .slice(1)
      .flat()
      .filter((v) => v !== null && !Number.isNaN(v)),
  ).sort();
  if (!values.length) return { min: -1, max: 1 };
  const [low, high] = [0.03, 0.97].map((share) => values[Math.round(share * (values.length - 1))]);
  const room = 0.45 * (high - low) + 1e-3;
  return { min: low - room, max: high + room };
}
