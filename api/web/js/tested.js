// Cuts that were tried: CUTS.csv as the commands read it, marks in the chart, and how many are classified correctly.
import { Problem } from "./api.js";
import { h } from "./dom.js";

const COLUMNS = ["spindle_speed_rpm", "axial_depth_mm", "verdict"];
const VERDICTS = ["stable", "chatter", "marginal"];
/** What the service takes: cuts, and the range of each number. */
const MOST = 1000;
const RANGES = { spindle_speed_rpm: [100, 200_000], axial_depth_mm: [0, 500] };
/** What marks a verdict: symbol in the chart, sign in the text, colour. */
export const MARKS = {
  stable: ["circle-open", "○", "good"],
  chatter: ["x-thin-open", "✕", "bad"],
  marginal: ["triangle-up-open", "△", "doubt"],
};

/** The cuts of a text table: comma, semicolon or tab, a decimal comma with the latter two. */
export function testedCuts(name, text) {
  const wrong = (field, found, allowed) => {
    throw new Problem(0, { detail: `${name}: ${field}: found ${found || "nothing"}, allowed is ${allowed}` });
  };
  const lines = text
    .replace(/^\ufeff/, "")
    .split(/\r?\n/)
    .map((line, i) => [i + 1, line.trim()])
    .filter(([, line]) => line && !line.startsWith("#"));
  const first = lines.shift()?.[1] ?? "";
  const divider = ["\t", ";", ","].find((each) => first.includes(each)) ?? ",";
  const header = first.split(divider).map((cell) => cell.trim());
  const places = COLUMNS.map((column) => {
    if (!header.includes(column)) wrong(`column ${column}`, `only ${header.join(", ")}`, `columns ${COLUMNS.join(", ")}`);
    return header.indexOf(column);
  });
  if (!lines.length || lines.length > MOST) wrong("cuts", lines.length ? String(lines.length) : "", `1 to ${MOST} of them`);
  return lines.map(([number, line]) => {
    const [speed, depth, seen] = places.map((place) => line.split(divider)[place]?.trim() ?? "");
    const within = (field, written) => {
      const value = Number(divider === "," ? written : written.replace(",", "."));
      const [least, most] = RANGES[field];
      const fits = written && value >= least && value > 0 && value <= most;
      return fits
        ? value
        : wrong(`line ${number}, ${field}`, written, `a number ${least ? `from ${least} to` : "above 0 and at most"} ${most}`);
    };
    if (!VERDICTS.includes(seen.toLowerCase())) wrong(`line ${number}, verdict`, seen, VERDICTS.join(", "));
    return { spindle_speed_rpm: within(COLUMNS[0], speed), axial_depth_mm: within(COLUMNS[1], depth), verdict: seen.toLowerCase() };
  });
}

/** Cuts as an address holds them: speed, depth and the verdict's first letter. */
export const asAddress = (cuts) => cuts.map((cut) => `${cut.spindle_speed_rpm}:${cut.axial_depth_mm}:${cut.verdict[0]}`).join(" ");

/** The cuts of an address; what is none is left out. */
export function fromAddress(written) {
  return written.split(" ").flatMap((each) => {
    const [, speed, depth, letter] = /^([\d.e+-]+):([\d.e+-]+):([scm])$/.exec(each) ?? [];
    const verdict = VERDICTS.find((word) => word[0] === letter);
    const cut = { spindle_speed_rpm: Number(speed), axial_depth_mm: Number(depth), verdict };
    return verdict && Number.isFinite(cut.spindle_speed_rpm + cut.axial_depth_mm) ? [cut] : [];
  });
}

/** How a tooling's limits stand to them, in words. */
export function toldRight(tally) {
  const right = tally.stable_stable + tally.chatter_chatter;
  const decided = right + tally.stable_chatter + tally.chatter_stable;
  const more = [
    tally.stable_chatter ? `${tally.stable_chatter} chattered where none was expected` : null,
    tally.chatter_stable ? `${tally.chatter_stable} stable beyond the limit` : null,
    tally.stable_marginal + tally.chatter_marginal ? `${tally.stable_marginal + tally.chatter_marginal} marginal` : null,
  ].filter(Boolean);
  const words = decided ? [`${right} of ${decided} classified correctly (${Math.round(100 * tally.share_right)} %)`, ...more] : more;
  return words.join(", ");
}

/** What the marks mean, of those that are there. */
export function testedLegend(cuts) {
  const seen = VERDICTS.filter((verdict) => cuts.some((cut) => cut.verdict === verdict));
  return h(
    "ul",
    { class: "legend tested" },
    seen.map((verdict) => h("li", null, h("span", { class: MARKS[verdict][2], "aria-hidden": "true" }, MARKS[verdict][1]), verdict)),
  );
}
