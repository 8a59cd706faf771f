// Numbers with their standard deviations, and those of drawings before and after something was learned of them.
import { h } from "../dom.js";
import { plain, significant } from "../units.js";

/** A number with its standard deviation, both cut where the deviation says that digits end. */
export function withSpread(value, spread, times = 1) {
  // a mode at critical damping stays there: that is no number of a hundred digits
  if (spread === null || spread === undefined || spread * times < 1e-6) return significant(value * times, 4);
  const place = spread > 0 ? Math.max(0, 1 - Math.floor(Math.log10(spread * times))) : 3;
  const digits = Math.min(place, 6);
  return h(
    "span",
    { class: "nowrap" },
    plain(value * times, digits, digits),
    h("span", { class: "soft" }, ` ± ${plain(spread * times, digits, digits)}`),
  );
}

/** A number of a drawing and its standard deviation; contacts have ten digits in front of their point. */
const numberOf = (value, spread) =>
  Math.abs(value) < 1e5 ? withSpread(value, spread) : h("span", { class: "nowrap" }, power(value), h("span", { class: "soft" }, ` ± ${power(spread)}`));

const power = (value) => {
  const [digits, exponent] = value.toExponential(1).split("e");
  return `${digits}·10${[...String(Number(exponent))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`;
};

/** What becomes of the models of a tooling that is taken over. */
export const OWN = "Taken over, a tooling belongs to no model any more: what is known of its models is in its own numbers.";

/** Columns of a table of numbers of drawings, whose rows tell `what` and `unit`; `old(row)` and `next(row)` are [value, deviation]. */
export const beforeAndAfter = (before, old, after, next) => [
  { name: "What", cell: (r) => [r.what, h("span", { class: "soft small nowrap" }, ` ${r.unit}`)] },
  { name: before, number: true, cell: (r) => numberOf(...old(r)) },
  { name: after, number: true, cell: (r) => numberOf(...next(r)) },
];
