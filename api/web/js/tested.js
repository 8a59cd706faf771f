// Cuts that were tried: CUTS.csv as the service reads it, marks in the chart, and how many are classified correctly.
import { Problem, send } from "./api.js";
import { h } from "./dom.js";

const VERDICTS = ["stable", "chatter", "marginal"];
/** What marks a verdict: symbol in the chart, sign in the text, colour. */
export const MARKS = {
  stable: ["circle-open", "○", "good"],
  chatter: ["x-thin-open", "✕", "bad"],
  marginal: ["triangle-up-open", "△", "doubt"],
};

/** The cuts of CUTS.csv, as the service reads them, and which columns it leaves aside. */
export async function testedCuts(name, file) {
  const answer = await send("POST", "tested-cuts/preview", { body: file, headers: { "Content-Type": "text/csv" } }).catch((error) => {
    throw error instanceof Problem ? new Problem(error.status, { detail: `${name}: ${error.message}`, errors: error.errors }) : error;
  });
  return answer.json();
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
