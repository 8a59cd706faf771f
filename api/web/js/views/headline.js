// What to set, in words: a speed, the recommended depth beside the stability limit, and why.
import { SERIES } from "../charts.js";
import { fill, h } from "../dom.js";
import { libraryDrawing } from "../drawing.js";
import { plain, q, text } from "../units.js";
import { cardLink } from "./card_link.js";
import { QUICK } from "./change_question.js";

const told = (found, i) => found.advice?.[i] ?? found.lobes[i];

/** The recommended cuts of a tooling: within power and torque where these were asked for. */
export const recommended = (found, i) => told(found, i).highest_removal ?? told(found, i).recommended;

/** Limits around the recommended cuts, by the method that computed them. */
export const around = (found, i) => told(found, i).around;

/** Whether lobes only say where to look. */
export const isPreview = (lobes) => lobes.method === QUICK;

/** Whether a tooling's recommended cuts are not computed yet. */
const isComing = (found, i) => !found.advice && found.lobes[i].recommended_by === null;

/** What to set, said first: a speed, a depth, and why. */
export function headline(found, question) {
  const cards = found.lobes.length;
  const articles = found.lobes.map((lobes, i) => {
    const [best, ...further] = recommended(found, i);
    // a tip's cutter is in no library
    const drawing = question.tip?.cutter ? null : h("div", { class: "mini" }, libraryDrawing(lobes.tooling, { brief: true }));
    const key = h("span", { class: `key line ${SERIES[i % SERIES.length]}`, "aria-hidden": "true" });
    if (!best && isComing(found, i)) {
      return h(
        "article",
        { class: "best", "aria-busy": "true" },
        h("h2", null, key, lobes.tooling),
        h("p", null, "The lobes are a preview. The recommended cut is being computed …"),
        drawing,
      );
    }
    if (!best) {
      const limit = lobes.absolute_limit_mm;
      const below = limit === null ? "" : ` Stable below ${text("depth", limit)} everywhere.`;
      const refused = told(found, i).warnings.find((each) => each.startsWith("no cut is recommended"));
      const why = refused ? `${refused}.` : lobes.withheld ? `No cut is recommended: ${lobes.withheld}.` : `No cut is recommended at these speeds.${below}`;
      return h(
        "article",
        { class: "best" },
        h("h2", null, key, lobes.tooling),
        h("p", null, why),
        drawing,
      );
    }
    return h(
      "article",
      { class: "best", dataset: { tooling: lobes.tooling, rpm: String(best.spindle_speed_rpm) } },
      h("h2", null, key, lobes.tooling),
      h(
        "p",
        { class: "set" },
        h("span", { class: "figure" }, h("output", null, plain(best.spindle_speed_rpm)), h("span", { class: "of" }, " rev/min")),
        best.recommended_depth_mm === null
          ? null
          : h("span", { class: "figure" }, h("span", { class: "of" }, "recommended depth "), q("depth", best.recommended_depth_mm)),
      ),
      best.recommended_depth_mm === null ? unlimited(best, question) : null,
      h(
        "p",
        null,
        "stability limit ",
        limitOf(best, question),
        best.removal_rate_cm3_per_min === null
          ? null
          : [
              " · ",
              q("removal", best.removal_rate_cm3_per_min),
              " · ",
              q("power", best.power_kw),
              " · ",
              q("torque", best.torque_nm),
              ` · ${bounds(best.bound)}`,
            ],
      ),
      further.length
        ? h(
            "p",
            { class: "soft small" },
            "Or ",
            further.map((cut, k) => [
              k ? " and " : "",
              `${plain(cut.spindle_speed_rpm)}\u00a0rev/min`,
              cut.recommended_depth_mm === null ? null : [" at ", q("depth", cut.recommended_depth_mm)],
              " (limit ",
              limitOf(cut, question),
              ")",
            ]),
          )
        : null,
      heldBack(best, told(found, i).recommended_by, false),
      told(found, i).state ? h("p", { class: "soft small" }, `For: ${told(found, i).state}.`) : null,
      bandOf(found, i),
      drawing,
      question.tip ? null : cardLink(lobes.tooling),
    );
  });
  return h("section", { class: `bests${cards === 1 ? " one" : ""}`, "aria-label": "Recommended cuts" }, articles);
}

/** What dominates the band of the recommended cut's limit, and what would narrow it. */
const bandOf = (found, i) => {
  const words = told(found, i).band?.in_words;
  return words ? h("p", { class: "small dominates" }, `${words}.`) : null;
};

/** Say that a recommended cut, which was to come, does not. */
export function notComputed(best) {
  best.removeAttribute("aria-busy");
  fill(best.querySelector("p"), "The lobes are a preview. No recommended cut has been computed.");
}

/** The stability limit of a cut or a speed; null is none up to the depth that was asked for. */
export const limitOf = (cut, question, options) =>
  cut.limit_depth_mm === null ? ["above ", q("depth", question.max_depth_mm, options)] : q("depth", cut.limit_depth_mm, options);

/** What is said in place of a depth: how deep limits were looked for tells nothing of how deep one may cut. */
const unlimited = (cut, question) =>
  h(
    "p",
    { class: "unlimited" },
    cut.why
      ? `${cut.why[0].toUpperCase()}${cut.why.slice(1)}.`
      : [
          "Nothing up to ",
          q("depth", question.max_depth_mm),
          " limits this cut, so no depth is recommended. Ask for a deeper cut to see where its limit lies.",
        ],
  );

/** How the recommended depth follows from the stability limit, step by step, and which method computed it. */
export function heldBack(cut, by, named = true) {
  const steps = cut?.held_back;
  if (!steps || cut.limit_depth_mm === null) return null;
  const chain = [
    [named ? "stability limit " : "Stability limit ", q("depth", cut.limit_depth_mm)],
    [q("depth", steps.within_tolerance_mm), ` within ±${plain(steps.tolerance_percent, 1)} % of the speed`],
    steps.with_probability_mm === null ? null : [q("depth", steps.with_probability_mm), ` with a probability of ${plain(steps.probability_percent, 1)} %`],
    [q("depth", steps.less_reserve_mm), ` less ${plain(steps.reserve_percent, 1)} %`],
  ].filter(Boolean);
  return h(
    "p",
    { class: "soft small held-back" },
    named ? `At ${plain(cut.spindle_speed_rpm)} rev/min: ` : null,
    chain.map((each, k) => [k ? " → " : "", each]),
    by ? `. Computed by ${by}.` : ".",
  );
}

const bounds = (bound) =>
  ({
    chatter: "limited by chatter",
    power: "limited by the spindle's power",
    torque: "limited by the spindle's torque",
    speed: "limited by the highest speed",
    depth: "limited by nothing that was looked for",
  })[bound] ?? bound;
