// The answers: what to set in words, lobes, tooltip FRF, and toolings side by side.
import { SERIES } from "../charts.js";
import { add, card, fill, h, note, table, whisper } from "../dom.js";
import { removalPer } from "../figures.js";
import { q, u } from "../units.js";
import { frfCard } from "./frf_card.js";
import { headline, heldBack, limitOf, recommended } from "./headline.js";
import { lobesCard } from "./lobes_card.js";

/** Show an answer; `part(partial)` of what is returned shows limits of a better one that are known already. */
export function results(place, found, { toolings, body, tested, ontested, look }) {
  const question = body.lobes;
  const summaries = found.lobes.map((each) => toolings.find((t) => t.name === each.tooling));
  const feed = question.cut.feed_per_tooth_mm ?? null;
  // what a shape removes is no share of its depth: the recommended cuts tell it
  const removal = summaries.map((t) => (feed === null || t?.shape !== "flat" ? null : removalPer(t, question.cut, feed)));
  // whoever is writing a speed goes on
  const writing = place.querySelector(".reader input:focus")?.value;
  const lobes = lobesCard(found, removal, question, tested, ontested, look);
  const doubts = warnings(found);
  fill(place, headline(found, question));
  // beside what is recommended, since the lobes are to be in sight with it
  if (doubts) place.querySelector(".best h2").append(toDoubts(doubts));
  add(place, lobes.box, doubts, found.lobes.length > 1 ? comparison(found, summaries, question) : null, frfCard(found, body, look));
  if (writing !== undefined) {
    const speed = place.querySelector(".reader input");
    speed.value = writing;
    speed.focus();
  }
  whisper(
    [...place.querySelectorAll(".best")]
      .map((each) => each.querySelector("h2").textContent + ": " + (each.querySelector(".set")?.textContent ?? ""))
      .join("; "),
  );
  return { part: lobes.part };
}

function warnings(found) {
  const told = new Set([...found.lobes, ...(found.advice ?? []), ...found.tips].flatMap((each) => each.warnings));
  return told.size ? note("doubt", ...told) : null;
}

function toDoubts(doubts) {
  const count = doubts.childElementCount;
  const words = count === 1 ? "1 warning" : `${count} warnings`;
  return h("button", { type: "button", class: "mark doubt", "data-sign": "!", onclick: () => doubts.scrollIntoView({ block: "center" }) }, words);
}

function comparison(found, summaries, question) {
  const rows = found.lobes.map((lobes, i) => ({
    lobes,
    i,
    stickout: summaries[i]?.stickout_mm ?? null,
    best: recommended(found, i)[0] ?? null,
  }));
  const top = Math.max(...rows.map((r) => r.best?.removal_rate_cm3_per_min ?? 0));
  const column = (name, kind, value, digits = null) => ({
    name,
    unit: u(kind),
    number: true,
    cell: (r) => q(kind, value(r) ?? null, { bare: true, digits }),
  });
  const limit = (name, cut) => ({
    name,
    unit: u("depth"),
    number: true,
    cell: (r) => (cut(r) ? limitOf(cut(r), question, { bare: true }) : null),
  });
  const columns = [
    {
      name: "Tooling",
      cell: (r) => [
        h("span", { class: `key line ${SERIES[r.i % SERIES.length]}`, "aria-hidden": "true" }),
        r.lobes.tooling,
        top && r.best?.removal_rate_cm3_per_min === top ? h("div", { class: "soft small" }, "removes most") : null,
      ],
    },
    column("Stickout", "length", (r) => r.stickout, 1),
    column("Stable at any speed", "depth", (r) => r.lobes.absolute_limit_mm),
    column("Recommended speed", "speed", (r) => r.best?.spindle_speed_rpm),
    column("Recommended depth", "depth", (r) => r.best?.recommended_depth_mm),
    limit("Stability limit", (r) => r.best),
    column("Removes", "removal", (r) => r.best?.removal_rate_cm3_per_min),
  ];
  const box = card("Side by side", null, table("Toolings side by side", columns, rows), rows.length ? heldBack(rows[0].best, (found.advice ?? found.lobes)[0].recommended_by) : null);
  box.classList.add("wide");
  return box;
}
