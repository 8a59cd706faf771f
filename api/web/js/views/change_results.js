// The answers: what to set in words, lobes, tooltip FRF, and toolings side by side.
import { getText, send } from "../api.js";
import { add, card, choices, fill, h, note, save, table } from "../dom.js";
import { chart, legend, SERIES } from "../charts.js";
import { libraryDrawing } from "../drawing.js";
import { frfFigure, lobeFigure, removalPer } from "../figures.js";
import { failed, quantity } from "../forms.js";
import { plain, q, text } from "../units.js";

let parts = "polar";
let shown = "both";

export function results(place, found, { toolings, body }) {
  const question = body.lobes;
  const summaries = found.lobes.map((each) => toolings.find((t) => t.name === each.tooling));
  const feed = question.cut.feed_per_tooth_mm ?? null;
  const removal = summaries.map((t) => (feed === null || !t ? null : removalPer(t, question.cut.immersion, feed)));
  const several = found.lobes.length > 1;
  fill(place, headline(found, removal, question), warnings(found));
  if (several) add(place, comparison(found, summaries, removal, question));
  add(place, lobesCard(found, removal, question), frfCard(found, body));
}

/** What to set, said first: a speed, a depth, and why. */
function headline(found, removal, question) {
  const cards = found.lobes.length;
  const articles = found.lobes.map((lobes, i) => {
    const advice = found.advice?.[i];
    const best = advice?.highest_removal[0];
    const pocket = lobes.best_speeds[0];
    const drawing = h("div", { class: "mini" }, libraryDrawing(lobes.tooling));
    const key = h("span", { class: `key line ${SERIES[i % SERIES.length]}`, "aria-hidden": "true" });
    if (!best && !pocket) {
      const limit = lobes.absolute_limit_mm;
      return h("article", { class: "best" }, h("h2", null, key, lobes.tooling), h("p", null, limit === null ? `Stable at every speed up to ${text("depth", question.max_depth_mm)}.` : `No pocket between these speeds; stable below ${text("depth", limit)} everywhere.`), drawing);
    }
    const rpm = best?.spindle_speed_rpm ?? pocket.spindle_speed_rpm;
    const depth = best?.axial_depth_mm ?? pocket.limit_depth_mm ?? question.max_depth_mm;
    const further = (best ? advice.highest_removal.slice(1, 3).map((p) => [p.spindle_speed_rpm, p.axial_depth_mm]) : lobes.best_speeds.slice(1, 3).map((b) => [b.spindle_speed_rpm, b.limit_depth_mm ?? question.max_depth_mm]));
    return h("article", { class: "best", dataset: { tooling: lobes.tooling, rpm: String(rpm) } },
      h("h2", null, key, lobes.tooling),
      h("p", { class: "set" }, h("span", { class: "figure" }, h("output", null, plain(rpm)), h("span", { class: "of" }, " rev/min")), h("span", { class: "figure" }, h("span", { class: "of" }, best ? "cut " : "up to "), q("depth", depth), h("span", { class: "of" }, " deep"))),
      best
        ? h("p", null, q("removal", best.removal_rate_cm3_per_min), " · ", q("power", best.power_kw), " · ", q("torque", best.torque_nm), ` · ${bounds(best.bound)}`)
        : h("p", null, "The limit itself, without a reserve."),
      further.length ? h("p", { class: "soft" }, "Or ", further.map(([speed, deep], k) => [k ? " and " : "", `${plain(speed)} rev/min at `, q("depth", deep)])) : null,
      best && cards === 1 ? reserve(pocket, question) : null,
      drawing);
  });
  return h("section", { class: `bests${cards === 1 ? " one" : ""}`, "aria-label": "Best speeds" }, articles);
}

/** How sure the recommendation is, and what it stays away from. */
function reserve(pocket, question) {
  return h("p", { class: "soft small" }, "10 % below the limit that 95 % of the machines allowed by the records reach, with the speed right within 1 %.",
    pocket ? [` The deepest pocket itself: ${plain(pocket.spindle_speed_rpm)} rev/min, `, q("depth", pocket.limit_depth_mm ?? question.max_depth_mm), "."] : null);
}

const bounds = (bound) => ({ chatter: "chatter stands against more", power: "the spindle's power stands against more", torque: "the spindle's torque stands against more", speed: "the highest speed", depth: "the deepest cut that was asked for" })[bound] ?? bound;

function warnings(found) {
  const told = new Set([...found.lobes, ...(found.advice ?? []), ...found.tips].flatMap((each) => each.warnings));
  return told.size ? note("doubt", ...told) : null;
}

function at(lobes, rpm) {
  const speeds = lobes.spindle_speed_rpm;
  let k = 0;
  speeds.forEach((each, i) => {
    if (Math.abs(each - rpm) < Math.abs(speeds[k] - rpm)) k = i;
  });
  return k;
}

function lobesCard(found, removal, question) {
  const picture = chart("Stability lobes", "lobes");
  picture.draw(() => lobeFigure(found.lobes, { maxDepth: question.max_depth_mm, removal, recommended: found.advice?.map((a) => a.highest_removal[0]) }));
  const first = found.lobes[0];
  const start = found.advice?.[0]?.highest_removal[0]?.spindle_speed_rpm ?? first.best_speeds[0]?.spindle_speed_rpm ?? first.spindle_speed_rpm[0];
  const speed = quantity("At a speed of", "speed", start);
  const read = h("ul", { class: "reads", "aria-live": "polite" });
  const show = () => {
    const rpm = speed.input.base;
    fill(read, !Number.isFinite(rpm) || rpm === null ? h("li", { class: "soft" }, "Write a speed.") : found.lobes.map((lobes, i) => {
      const k = at(lobes, rpm);
      const depth = lobes.limit_depth_mm[k];
      const low = lobes.limit_depth_low_mm?.[k];
      const high = lobes.limit_depth_high_mm?.[k];
      const chatter = lobes.chatter_frequency_hz[k];
      return h("li", null,
        several(found) ? h("strong", null, `${lobes.tooling}: `) : null,
        depth === null ? ["stable up to ", q("depth", question.max_depth_mm)] : ["stable to ", q("depth", depth)],
        low !== undefined && low !== null && high ? [" (95 %: ", q("depth", low, { bare: true }), " to ", q("depth", high), ")"] : null,
        removal[i] ? [" · ", q("removal", removal[i] * lobes.spindle_speed_rpm[k] * (depth ?? question.max_depth_mm))] : null,
        chatter === null ? null : ` · beyond it chatter at ${plain(chatter)} Hz`,
        lobes.flip[k] ? " · period doubling" : null);
    }));
  };
  speed.input.addEventListener("input", show);
  show();
  const csv = h("button", { type: "button", class: "quiet", onclick: () => save("LOBES.csv", lobesCsv(found.lobes), "text/csv") }, "LOBES.csv");
  return card("Stability lobes", csv,
    several(found) ? legend(found.lobes.map((l, i) => ({ name: l.tooling, series: SERIES[i % SERIES.length] }))) : null,
    picture,
    h("p", { class: "small soft" }, "Stable below the line. Shaded around it: where 95 % of the machines lie that the records allow. Diamonds: the deepest pockets. Dot: what is recommended. Hover for depth, removal rate and chatter frequency; drag to look closer, double click to come back."),
    h("div", { class: "reader" }, speed, read));
}

const several = (found) => found.lobes.length > 1;

function frfCard(found, body) {
  const picture = chart("Tooltip FRF", "frf");
  const draw = () => picture.draw(() => frfFigure(found.tips, { parts, shown }));
  draw();
  const axes = Object.keys(found.tips[0].axes);
  const one = found.tips.length === 1;
  const keys = one
    ? axes.map((name, k) => ({ name: `${name} direction`, series: SERIES[k] }))
    : [...found.tips.map((t, i) => ({ name: t.tooling, series: SERIES[i % SERIES.length] })), ...axes.map((name, k) => ({ name, series: "s6", dash: k ? "dash" : "solid" }))];
  const place = h("div");
  const csv = found.tips.map((tip, i) => h("button", { type: "button", class: "quiet", onclick: async () => {
    try {
      const answer = await send("POST", "tooltip", { json: body.tips[i], headers: { Accept: "text/csv" } });
      save(`${tip.tooling}-FRF.csv`, await answer.text(), "text/csv");
    } catch (error) {
      failed(place, error);
    }
  } }, one ? "FRF.csv" : `${tip.tooling}.csv`));
  return card("Tooltip FRF", csv,
    h("div", { class: "row-of-buttons" },
      choices("Parts", [["polar", "Magnitude, phase"], ["cartesian", "Real, imaginary"]], parts, (value) => { parts = value; draw(); }),
      axes.length > 1 ? choices("Directions", [["both", "X and Y"], ...axes.map((a) => [a, a])], shown, (value) => { shown = value; draw(); }) : null),
    legend(keys), picture, h("p", { class: "small soft" }, "Shaded: 95 % band."), place);
}

function comparison(found, summaries, removal, question) {
  const deepest = found.lobes.map((l) => l.best_speeds[0] ?? null);
  const rows = found.lobes.map((lobes, i) => ({ lobes, i, tooling: summaries[i], best: found.advice?.[i]?.highest_removal[0] ?? null, pocket: deepest[i] }));
  const top = Math.max(...rows.map((r) => r.best?.removal_rate_cm3_per_min ?? 0));
  const box = card("Side by side", null, table("Toolings side by side", [
    { name: "Tooling", cell: (r) => [h("span", { class: `key line ${SERIES[r.i % SERIES.length]}`, "aria-hidden": "true" }), r.lobes.tooling, r.best && r.best.removal_rate_cm3_per_min === top ? h("span", { class: "soft small" }, " removes most") : null] },
    { name: "Stickout", number: true, cell: (r) => (r.tooling ? q("length", r.tooling.stickout_mm, { digits: 1 }) : "–") },
    { name: "Stable at every speed", number: true, cell: (r) => q("depth", r.lobes.absolute_limit_mm) },
    { name: "Deepest pocket", number: true, cell: (r) => (r.pocket ? [q("depth", r.pocket.limit_depth_mm ?? question.max_depth_mm), " at ", q("speed", r.pocket.spindle_speed_rpm, { bare: true })] : "–") },
    { name: "Recommended", number: true, cell: (r) => (r.best ? [q("speed", r.best.spindle_speed_rpm), ", ", q("depth", r.best.axial_depth_mm)] : "–") },
    { name: "Removal", number: true, cell: (r) => (r.best ? q("removal", r.best.removal_rate_cm3_per_min) : "–") },
  ], rows), found.advice ? reserve(null, question) : null);
  box.classList.add("wide");
  return box;
}

function lobesCsv(lobes) {
  const lines = ["tooling,spindle_speed_rpm,limit_depth_mm,chatter_frequency_hz,lobe,limit_depth_low_mm,limit_depth_high_mm"];
  for (const each of lobes) {
    each.spindle_speed_rpm.forEach((rpm, k) => lines.push([each.tooling, rpm, each.limit_depth_mm[k], each.chatter_frequency_hz[k], each.lobe[k], each.limit_depth_low_mm?.[k], each.limit_depth_high_mm?.[k]].map((v) => v ?? "").join(",")));
  }
  return `${lines.join("\n")}\n`;
}
