// What to set, in words: a speed, a depth, and why.
import { SERIES } from "../charts.js";
import { h } from "../dom.js";
import { libraryDrawing } from "../drawing.js";
import { plain, q, text } from "../units.js";

/** What to set, said first: a speed, a depth, and why. */
export function headline(found, removal, question) {
  const cards = found.lobes.length;
  const articles = found.lobes.map((lobes, i) => {
    const advice = found.advice?.[i];
    const best = advice?.highest_removal[0];
    const pocket = lobes.best_speeds[0];
    const drawing = h("div", { class: "mini" }, libraryDrawing(lobes.tooling));
    const key = h("span", { class: `key line ${SERIES[i % SERIES.length]}`, "aria-hidden": "true" });
    if (!best && !pocket) {
      const limit = lobes.absolute_limit_mm;
      return h(
        "article",
        { class: "best" },
        h("h2", null, key, lobes.tooling),
        h(
          "p",
          null,
          limit === null
            ? `Stable at every speed up to ${text("depth", question.max_depth_mm)}.`
            : `No pocket between these speeds; stable below ${text("depth", limit)} everywhere.`,
        ),
        drawing,
      );
    }
    const rpm = best?.spindle_speed_rpm ?? pocket.spindle_speed_rpm;
    const depth = best?.axial_depth_mm ?? pocket.limit_depth_mm ?? question.max_depth_mm;
    const further = best
      ? advice.highest_removal.slice(1, 3).map((p) => [p.spindle_speed_rpm, p.axial_depth_mm])
      : lobes.best_speeds.slice(1, 3).map((b) => [b.spindle_speed_rpm, b.limit_depth_mm ?? question.max_depth_mm]);
    return h(
      "article",
      { class: "best", dataset: { tooling: lobes.tooling, rpm: String(rpm) } },
      h("h2", null, key, lobes.tooling),
      h(
        "p",
        { class: "set" },
        h("span", { class: "figure" }, h("output", null, plain(rpm)), h("span", { class: "of" }, " rev/min")),
        h(
          "span",
          { class: "figure" },
          h("span", { class: "of" }, best ? "cut " : "up to "),
          q("depth", depth),
          h("span", { class: "of" }, " deep"),
        ),
      ),
      best
        ? h(
            "p",
            null,
            q("removal", best.removal_rate_cm3_per_min),
            " · ",
            q("power", best.power_kw),
            " · ",
            q("torque", best.torque_nm),
            ` · ${bounds(best.bound)}`,
          )
        : h("p", null, "The limit itself, without a reserve."),
      further.length
        ? h(
            "p",
            { class: "soft" },
            "Or ",
            further.map(([speed, deep], k) => [k ? " and " : "", `${plain(speed)}\u00a0rev/min at `, q("depth", deep)]),
          )
        : null,
      best && cards === 1 ? reserve(pocket, question) : null,
      drawing,
    );
  });
  return h("section", { class: `bests${cards === 1 ? " one" : ""}`, "aria-label": "Best speeds" }, articles);
}

/** How sure the recommendation is, and what it stays away from. */
export function reserve(pocket, question) {
  return h(
    "p",
    { class: "soft small reserve" },
    "10 % below the limit that 95 % of the machines allowed by the records reach, with the speed right within 1 %.",
    pocket
      ? [
          ` The deepest pocket itself: ${plain(pocket.spindle_speed_rpm)} rev/min, `,
          q("depth", pocket.limit_depth_mm ?? question.max_depth_mm),
          ".",
        ]
      : null,
  );
}

const bounds = (bound) =>
  ({
    chatter: "chatter stands against more",
    power: "the spindle's power stands against more",
    torque: "the spindle's torque stands against more",
    speed: "the highest speed",
    depth: "the deepest cut that was asked for",
  })[bound] ?? bound;
