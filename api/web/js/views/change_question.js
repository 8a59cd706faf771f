// What is asked after a tool change: its fields, what they become, and what can be seen to be wrong before anything is sent.
import { described, Problem } from "../api.js";
import { quantity } from "../forms.js";
import { text } from "../units.js";

/** The method that answers at once. */
export const QUICK = "zero-order";

/** All methods that the service has, as [name, words]. */
export async function methods() {
  const names = (await described()).components.schemas.MethodName.enum;
  return names.map((name) => [name, name[0].toUpperCase() + name.slice(1) + (name === QUICK ? ": at once" : "")]);
}

// what an address may say beside choices and run-out: name in the query, kind, default, where it goes in the body, least and most; without an end the service
// knows what is possible, and says what is usual beside it
export const NUMBERS = [
  ["im", "percent", 50, "cut.immersion", 0.1, 100, "Radial immersion"],
  ["ya", "length", null, "cut.y_from_mm", -2000, 2000, "Block from"],
  ["yb", "length", null, "cut.y_to_mm", -2000, 2000, "Block to"],
  ["fz", "feed", 0.1, "cut.feed_per_tooth_mm", 0, Infinity, "Feed per tooth"],
  ["from", "speed", 4000, "speeds.from_rpm", 10, 500_000, "From"],
  ["to", "speed", 20_000, "speeds.to_rpm", 10, 500_000, "To"],
  ["step", "speed", 50, "speeds.step_rpm", 0.1, 100_000, "Step"],
  ["deep", "depth", 10, "max_depth_mm", 1e-4, 500, "Deepest that is asked for"],
  ["ktc", "pressure", null, "cut.ktc_mpa", 0, Infinity, "Tangential coefficient"],
  ["krc", "none", null, "cut.krc", -Infinity, Infinity, "Radial over tangential"],
  ["kac", "none", null, "cut.kac", -Infinity, Infinity, "Axial over tangential"],
  ["land", "displacement", null, "cut.wear_land_um", 0.01, 1000, "Wear land"],
  ["dent", "indentation", null, "cut.indentation", 1e9, 1e17, "Indentation"],
  ["mu", "none", 0.3, "cut.friction", 0, 2, "Friction of the worn land"],
  ["power", "power", null, "max_power_kw", 1e-3, 10_000, "Spindle power, at most"],
  ["torque", "torque", null, "max_torque_nm", 1e-3, 1e6, "Spindle torque, at most"],
  ["temp", "temperature", null, "temperature_c", -20, 120, "Temperature near the bearings"],
];

/** Which way the teeth enter, and where the feed goes, for choices. */
export const STRATEGIES = [["down", "Down milling"], ["up", "Up milling"]];
export const DIRECTIONS = ["+X", "-X", "+Y", "-Y"].map((each) => [each, each.replace("-", "−")]);

/** Fields for some of `NUMBERS`, with what an address says in place of what is usual. */
export const numberFields = (numbers, query) =>
  Object.fromEntries(numbers.map(([key, kind, usual, name, , , label]) => [key, quantity(label, kind, query.get(key) ? Number(query.get(key)) : usual, { name })]));

/** What an address says of such fields: nothing of what is usual. */
export const numbersAsAddress = (numbers, fields) =>
  Object.fromEntries(numbers.map(([key, , usual]) => [key, fields[key].input.base === usual ? null : fields[key].input.base]));

/** Most that an edge may stand out [µm]. */
const OUT = 1000;

/** Run-out tooth by tooth as an address says it [µm]; null where it says none. */
export function runoutOf(query) {
  const out = query.get("runout")?.split(" ").filter(Boolean).map(Number);
  return out?.length ? out : null;
}

/** What is asked of toolings on what they stand on, as `{machine: id}` or `{tip}`: lobes, advice where there is a feed, and FRFs. */
export function bodyOf(on, names, fields, { stock, strategy, direction, method, material, tested }) {
  const value = (key) => fields[key].input.base;
  const beside = stock === "block" ? { stock, y_from_mm: value("ya"), y_to_mm: value("yb") } : { immersion: value("im") / 100, strategy };
  const cut = { ...beside, feed_direction: direction };
  const plain = NUMBERS.filter(([key]) => ["fz", "ktc", "krc", "kac", "land", "dent"].includes(key) && value(key) !== null);
  for (const [key, , , name] of plain) cut[name.slice("cut.".length)] = value(key);
  // only a worn land rubs
  if (value("land") !== null) cut.friction = value("mu");
  if (value("runout") !== null) cut.runout_um = value("runout");
  if (material) cut.material = material;
  const speeds = { from_rpm: value("from"), to_rpm: value("to"), step_rpm: value("step") };
  const here = value("temp") === null ? on : { ...on, temperature_c: value("temp") };
  const lobes = { ...here, toolings: names, cut, speeds, max_depth_mm: value("deep"), method };
  // the recommended cut does not depend on the method of the lobes beside it
  const advice = value("fz") === null ? null : { ...lobes, method: QUICK };
  if (advice && value("power") !== null) advice.max_power_kw = value("power");
  if (advice && value("torque") !== null) advice.max_torque_nm = value("torque");
  if (tested.length) lobes.tested = tested;
  // a tip's cutter has no name in the library
  const tips = (names.length ? names : [null]).map((tooling) => (tooling === null ? { ...here } : { ...here, tooling }));
  return { lobes, advice, tips };
}

/** What can be seen to be wrong before anything is sent, in the units that are shown. */
export function checked(fields, faults, stock) {
  const errors = [...faults];
  const sides = ["ya", "yb"];
  for (const [key, kind, usual, name, least, most] of NUMBERS) {
    const { base, value } = fields[key].input;
    if (stock === "block" ? key === "im" : sides.includes(key)) continue;
    if (base === null && (usual === null || key === "fz") && !sides.includes(key)) continue;
    if (base === null) errors.push({ field: name, found: "nothing", allowed: "A number is needed here" });
    else if (!(base >= least && base <= most)) {
      errors.push({ field: name, found: value, allowed: `From ${text(kind, least, { bare: true })} to ${text(kind, most)}` });
    }
  }
  const out = fields.runout.input.base ?? [];
  if (!out.every((each) => Math.abs(each) <= OUT)) {
    const allowed = `A number for each tooth, from ${text("displacement", -OUT, { bare: true })} to ${text("displacement", OUT)}`;
    errors.push({ field: "cut.runout_um", found: fields.runout.input.value, allowed });
  }
  if (!errors.length && stock === "block" && fields.yb.input.base <= fields.ya.input.base)
    errors.push({ field: "cut.y_to_mm", found: text("length", fields.yb.input.base), allowed: "Above the first side" });
  const [from, upTo] = [fields.from.input.base, fields.to.input.base];
  if (!errors.length && upTo < from)
    errors.push({ field: "speeds.to_rpm", found: text("speed", upTo), allowed: "Not below the first speed" });
  return errors.length ? new Problem(0, { detail: "Something is not usable", errors }) : null;
}
