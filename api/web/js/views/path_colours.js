// What a part is coloured by: which column of the answer, in which colours, between which numbers.
import { h, s } from "../dom.js";
import { factor, plain, u, unit } from "../units.js";

/** Red to blue over a yellow that no bare material has, and from blue to yellow; told apart by those who see fewer colours, too. As [r, g, b]. */
const AROUND = [[178, 45, 40], [236, 124, 82], [255, 236, 150], [110, 172, 210], [34, 94, 168]];
const RISING = [[53, 42, 135], [20, 105, 190], [36, 160, 170], [125, 190, 110], [225, 190, 70], [250, 240, 70]];

/** Key, words, kind of the unit, colours, the middle between which two colours part, and the column. */
const KINDS = [
  { key: "margin", words: "Margin to chatter", kind: "none", column: "margin_low", stops: AROUND, ends: () => [0, 2], middle: "1 is the limit: red chatters" },
  { key: "error", words: "Form error", kind: "displacement", column: "form_error_um", stops: [...AROUND].reverse(), ends: even, middle: "above 0 material is left" },
  { key: "force", words: "Force", kind: "force", column: "peak_force_n", stops: RISING, ends: whole, middle: "across the tool's axis" },
  { key: "swing", words: "Vibration", kind: "displacement", column: "swing_um", stops: RISING, ends: whole, middle: "from end to end of the tip's way in a turn" },
  { key: "depth", words: "Depth", kind: "depth", column: "depth_mm", stops: RISING, ends: whole, middle: "of the material along the tool's axis" },
];

function whole(known) {
  const [low, high] = [Math.min(...known), Math.max(...known)];
  return high > low ? [low, high] : [low - 0.5 * Math.abs(low || 1), low + 0.5 * Math.abs(low || 1)];
}

function even(known) {
  const most = Math.max(...known.map(Math.abs)) || 1;
  return [-most, most];
}

/** The kinds of which an answer tells anything, each with `low`, `high` and `colour(value)`. */
export function coloursOf(columns) {
  return KINDS.flatMap((kind) => {
    const known = (columns[kind.column] ?? []).filter((each) => each !== null);
    if (!known.length) return [];
    const [low, high] = kind.ends(known.length > 50_000 ? known.filter((_, k) => k % 10 === 0) : known);
    const colour = (value) => {
      const at = Math.min(1, Math.max(0, (value - low) / (high - low))) * (kind.stops.length - 1);
      const k = Math.min(Math.floor(at), kind.stops.length - 2);
      return kind.stops[k].map((v, i) => v + (at - k) * (kind.stops[k + 1][i] - v));
    };
    return [{ ...kind, low, high, colour }];
  });
}

/** The scale of a kind, with its unit. */
export function scaleOf(kind) {
  const steps = 48;
  const parts = Array.from({ length: steps }, (_, k) => {
    const [r, g, b] = kind.colour(kind.low + ((k + 0.5) / steps) * (kind.high - kind.low));
    return s("rect", { x: k, y: 0, width: 1.05, height: 1, fill: `rgb(${Math.round(r)},${Math.round(g)},${Math.round(b)})` });
  });
  const shown = (value) => {
    const span = h("span", { class: "number" });
    const say = () => (span.textContent = `${plain(value * factor(kind.kind), Math.abs(kind.high * factor(kind.kind)) < 10 ? 2 : 0)}${kind.key === "margin" && value === kind.high ? " or more" : ""}`);
    span.quantity = say;
    span.dataset.quantity = kind.kind;
    say();
    return span;
  };
  return h(
    "figure",
    { class: "scale" },
    h("figcaption", { class: "small" }, kind.words, unit(kind.kind) ? [" [", u(kind.kind), "]"] : null, h("span", { class: "soft" }, `, ${kind.middle}; grey: nothing is told`)),
    s("svg", { viewBox: `0 0 ${steps} 1`, preserveAspectRatio: "none", "aria-hidden": "true" }, parts),
    h("div", { class: "ends small" }, shown(kind.low), shown(0.5 * (kind.low + kind.high)), shown(kind.high)),
  );
}
