// What numbers look like: millimetres or inches, chosen once; the service speaks millimetres, newtons and rev/min only.
import { h } from "./dom.js";

const INCH = 25.4;
const POUND = 4.4482216152605;
// kind: [unit, factor, digits] metric and inch; the factor turns the service's number into the shown one
const KINDS = {
  length: [
    ["mm", 1, 3],
    ["in", 1 / INCH, 4],
  ],
  depth: [
    ["mm", 1, 2],
    ["in", 1 / INCH, 4],
  ],
  feed: [
    ["mm", 1, 4],
    ["in", 1 / INCH, 5],
  ],
  feed_rate: [
    ["mm/min", 1, 0],
    ["in/min", 1 / INCH, 2],
  ],
  displacement: [
    ["µm", 1, 2],
    ["µin", 1000 / INCH, 1],
  ],
  receptance: [
    ["µm/N", 1e6, 4],
    ["µin/lbf", (1e9 / INCH) * POUND, 2],
  ],
  removal: [
    ["cm³/min", 1, 1],
    ["in³/min", 1000 / INCH ** 3, 2],
  ],
  force: [
    ["N", 1, 1],
    ["lbf", 1 / POUND, 2],
  ],
  torque: [
    ["N m", 1, 2],
    ["lbf ft", 1 / (POUND * INCH * 12e-3), 2],
  ],
  power: [
    ["kW", 1, 2],
    ["hp", 1 / 0.7456998715822702, 2],
  ],
  pressure: [
    ["N/mm²", 1, 0],
    ["ksi", (INCH * INCH) / POUND / 1000, 2],
  ],
  edge: [
    ["N/mm", 1, 2],
    ["lbf/in", INCH / POUND, 1],
  ],
  indentation: [
    ["N/m³", 1, 0],
    ["lbf/in³", (INCH / 1000) ** 3 / POUND, 0],
  ],
  speed: [
    ["rev/min", 1, 0],
    ["rev/min", 1, 0],
  ],
  hertz: [
    ["Hz", 1, 0],
    ["Hz", 1, 0],
  ],
  degree: [
    ["°", 1, 2],
    ["°", 1, 2],
  ],
  percent: [
    ["%", 1, 2],
    ["%", 1, 2],
  ],
  temperature: [
    ["°C", 1, 1],
    ["°C", 1, 1],
  ],
  none: [
    ["", 1, 3],
    ["", 1, 3],
  ],
};

/** The kind of what a declared unit is of. */
export const kindOf = (unit) => ({ mm: "length", deg: "degree", "%": "percent" })[unit] ?? "none";

let inch = false;
try {
  inch = localStorage.getItem("rcsa.units") === "inch";
} catch {
  // a browser that keeps nothing
}

export const isInch = () => inch;
const of = (kind) => KINDS[kind][inch ? 1 : 0];
export const unit = (kind) => of(kind)[0];
export const factor = (kind) => of(kind)[1];

/** A number with thin spaces between thousands. */
export function plain(value, digits = 0, least = 0) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = new Intl.NumberFormat("en-GB", { maximumFractionDigits: digits, minimumFractionDigits: least }).format(value);
  return text.replaceAll(",", "\u202f").replace("-", "−");
}

/** A number in so many significant digits, without an exponent where one can do without. */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4))
    return value
      .toExponential(digits - 1)
      .replace(/e\+?(-?\d+)$/, (_, power) => `·10${[...power].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`)
      .replace("-", "−");
  const decimals = size === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return plain(value, decimals, decimals);
}

/** The text of a quantity, with its unit unless told otherwise. */
export function text(kind, value, { digits = null, bare = false } = {}) {
  const [name, times, usual] = of(kind);
  if (value === null || value === undefined) return "–";
  const more = inch && digits !== null ? Math.max(0, usual - KINDS[kind][0][2]) : 0;
  const places = digits === null ? usual : digits + more;
  return plain(value * times, places, places) + (bare || !name ? "" : `${name === "°" ? "" : "\u00a0"}${name}`);
}

/** A quantity that follows the switch of units by itself. */
export function q(kind, value, options = {}) {
  const span = h("span", { class: "number nowrap" }, text(kind, value, options));
  span.quantity = () => span.replaceChildren(text(kind, value, options));
  span.dataset.quantity = kind;
  return span;
}

/** The name of a unit that follows the switch. */
export function u(kind, around = (name) => name) {
  const span = h("span", null, around(unit(kind)));
  span.quantity = () => span.replaceChildren(around(unit(kind)));
  span.dataset.quantity = kind;
  return span;
}

/** An input for a quantity: `base` is its number as the service wants it, NaN where nothing usable is written. */
export function quantityInput(kind, value, props = {}) {
  const input = h("input", { type: "text", inputmode: "decimal", autocomplete: "off", ...props });
  let base = value;
  const show = () => {
    input.value = base === null || base === undefined || Number.isNaN(base) ? "" : trimmed(base * factor(kind));
  };
  // a decimal comma is what many keyboards offer
  const read = () => {
    const written = input.value.trim().replace(",", ".");
    base = written === "" ? null : Number(written) / factor(kind);
  };
  input.addEventListener("input", read);
  Object.defineProperty(input, "base", {
    get: () => base,
    set: (next) => {
      base = next;
      show();
    },
  });
  input.quantity = show;
  input.dataset.quantity = kind;
  show();
  return input;
}

/** An input for several quantities with blanks or semicolons between them: `base` is their list, null where nothing is written. */
export function quantityListInput(kind, values, props = {}) {
  const input = h("input", { type: "text", autocomplete: "off", ...props });
  let base = values;
  const show = () => {
    input.value = (base ?? []).map((value) => (Number.isFinite(value) ? trimmed(value * factor(kind)) : "?")).join(" ");
  };
  input.addEventListener("input", () => {
    const written = input.value.split(/[\s;]+|,\s+/).filter(Boolean);
    base = written.length ? written.map((each) => Number(each.replace(",", ".")) / factor(kind)) : null;
  });
  Object.defineProperty(input, "base", {
    get: () => base,
    set: (next) => {
      base = next;
      show();
    },
  });
  input.quantity = show;
  input.dataset.quantity = kind;
  show();
  return input;
}

/** As a person would type it: few digits, powers of ten where zeros are hard to count. */
function trimmed(value) {
  const short = Number(value.toPrecision(7));
  const size = Math.abs(short);
  return size >= 1e6 || (size > 0 && size < 1e-4) ? short.toExponential().replace("e+", "e") : String(short);
}

/** Choose, and turn over everything that is shown. */
export function setInch(next) {
  inch = next;
  try {
    localStorage.setItem("rcsa.units", inch ? "inch" : "mm");
  } catch {
    // it holds for this visit then
  }
  for (const element of document.querySelectorAll("[data-quantity]")) element.quantity?.();
  window.dispatchEvent(new Event("units"));
}
