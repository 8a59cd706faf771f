// The answers: what to set in words, lobes, tooltip FRF, and toolings side by side.
import { send } from "../api.js";
import { add, card, choices, fill, h, note, save, table, whisper } from "../dom.js";
import { chart, legend, SERIES } from "../charts.js";
import { across, frfFigure, lobeFigure, removalPer } from "../figures.js";
import { failed, quantity } from "../forms.js";
import { testedCuts, testedLegend, toldRight } from "../tested.js";
import { plain, q, u } from "../units.js";
import { headline, limitOf, recommended, reserve } from "./headline.js";

let parts = "polar";
let shown = "both";

export function results(place, found, { toolings, body, tested, ontested }) {
  const question = body.lobes;
  const summaries = found.lobes.map((each) => toolings.find((t) => t.name === each.tooling));
  const feed = question.cut.feed_per_tooth_mm ?? null;
  const removal = summaries.map((t) => (feed === null || !t ? null : removalPer(t, question.cut.immersion, feed)));
  const several = found.lobes.length > 1;
  // a speed that somebody writes while the recommended cut comes stays
  const written = place.querySelector(".reader input:focus")?.value;
  fill(place, headline(found, question), warnings(found));
  add(
    place,
    lobesCard(found, removal, question, tested, ontested),
    several ? comparison(found, summaries, question) : null,
    frfCard(found, body),
  );
  if (written !== undefined) {
    const speed = place.querySelector(".reader input");
    speed.value = written;
    speed.focus();
    speed.dispatchEvent(new Event("input", { bubbles: false }));
  }
  whisper(
    [...place.querySelectorAll(".best")]
      .map((each) => each.querySelector("h2").textContent + ": " + (each.querySelector(".set")?.textContent ?? ""))
      .join("; "),
  );
}

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

function lobesCard(found, removal, question, tested, ontested) {
  const picture = chart("Stability lobes", "lobes");
  picture.draw(() =>
    lobeFigure(found.lobes, {
      maxDepth: question.max_depth_mm,
      removal,
      recommended: found.lobes.map((_, i) => recommended(found, i)[0]),
      tested: tested.cuts,
    }),
  );
  const first = found.lobes[0];
  const start = recommended(found, 0)[0]?.spindle_speed_rpm ?? first.spindle_speed_rpm[0];
  const speed = quantity("At a speed of", "speed", start);
  const read = h("ul", { class: "reads", "aria-live": "polite" });
  const show = () => {
    const rpm = speed.input.base;
    fill(
      read,
      !Number.isFinite(rpm) || rpm === null
        ? h("li", { class: "soft" }, "Write a speed.")
        : found.lobes.map((lobes, i) => {
            const k = at(lobes, rpm);
            const depth = lobes.limit_depth_mm[k];
            const low = lobes.limit_depth_low_mm?.[k];
            const high = lobes.limit_depth_high_mm?.[k];
            const chatter = lobes.chatter_frequency_hz[k];
            const deep = lobes.recommended_depth_mm[k];
            return h(
              "li",
              null,
              several(found) ? h("strong", null, `${lobes.tooling}: `) : null,
              "stability limit ",
              limitOf({ limit_depth_mm: depth }, question),
              low !== undefined && low !== null && high
                ? [" (95 %: ", q("depth", low, { bare: true }), " to ", q("depth", high), ")"]
                : null,
              deep === null ? ", no depth recommended" : [`, recommended depth ${lobes.recommended_by === lobes.method ? "" : "by this preview "}`, q("depth", deep)],
              removal[i] && deep !== null ? [" · ", q("removal", removal[i] * lobes.spindle_speed_rpm[k] * deep)] : null,
              chatter === null ? null : ` · beyond the limit chatter at ${plain(chatter)} Hz`,
              lobes.flip[k] ? " · period doubling" : null,
            );
          }),
    );
  };
  speed.input.addEventListener("input", show);
  show();
  const csv = h(
    "button",
    { type: "button", class: "quiet", onclick: () => save("LOBES.csv", lobesCsv(found.lobes), "text/csv") },
    "LOBES.csv",
  );
  const { choose, beside, fault } = testedParts(found.lobes, tested, ontested);
  return card(
    first.method === "zero-order" ? "Stability lobes" : `Stability lobes, ${first.method}`,
    [choose, csv],
    fault,
    several(found) ? legend(found.lobes.map((l, i) => ({ name: l.tooling, series: SERIES[i % SERIES.length] }))) : null,
    picture,
    beside,
    h(
      "p",
      { class: "small soft" },
      "The line is the stability limit. Shaded around it: where 95 % of the machines lie that the records allow. Diamonds: the highest ",
      "limits. Dot: the recommended cut. Hover for limit, recommended depth and chatter frequency; drag to look closer, double click to come back.",
    ),
    h("div", { class: "reader" }, speed, read),
  );
}

/** Cuts that were tried: where they are chosen, how the limits stand to them, and what was wrong with their file. */
function testedParts(lobes, tested, ontested) {
  const fault = h("div");
  const input = h("input", {
    type: "file",
    accept: ".csv,.txt,.tsv,text/csv",
    class: "unseen",
    tabindex: "-1",
    "aria-hidden": "true",
    onchange: async () => {
      const [file] = input.files;
      input.value = "";
      if (!file) return;
      try {
        ontested({ name: file.name, cuts: testedCuts(file.name, await file.text()) });
      } catch (error) {
        failed(fault, error);
      }
    },
  });
  const pick = h("button", { type: "button", class: "quiet", onclick: () => input.click() }, "Tested cuts …");
  const choose = h("span", null, pick, input);
  if (!tested.cuts.length) return { choose, beside: null, fault };
  const away = h("button", { type: "button", class: "quiet", onclick: () => ontested({ name: "", cuts: [] }) }, "Take them away");
  const told = lobes.map((each) =>
    h("li", null, lobes.length > 1 ? h("strong", null, `${each.tooling}: `) : `${tested.name}: `, toldRight(each.tested)),
  );
  return { choose, beside: h("div", { class: "tested-cuts" }, testedLegend(tested.cuts), away, h("ul", { class: "reads" }, told)), fault };
}

const several = (found) => found.lobes.length > 1;

function frfCard(found, body) {
  const picture = chart("Tooltip FRF", "frf");
  const draw = () => picture.draw(() => frfFigure(found.tips, { parts, shown }));
  draw();
  const axes = Object.keys(found.tips[0].axes);
  const one = found.tips.length === 1;
  const crossed = across(found.tips[0]).map(([name]) => name);
  const rpm = found.tips[0].spindle_speed_rpm;
  if (shown === "across" && !crossed.length) shown = "both";
  const keys = one
    ? [
        ...axes.map((name, k) => ({ name: `${name} direction`, series: SERIES[k] })),
        ...crossed.map((name, k) => ({ name, series: SERIES[axes.length + k], dash: "dash" })),
      ]
    : [
        ...found.tips.map((t, i) => ({ name: t.tooling, series: SERIES[i % SERIES.length] })),
        ...axes.map((name, k) => ({ name, series: "s6", dash: k ? "dash" : "solid" })),
      ];
  const place = h("div");
  const csv = found.tips.map((tip, i) =>
    h(
      "button",
      {
        type: "button",
        class: "quiet",
        onclick: async () => {
          try {
            const answer = await send("POST", "tooltip", { json: body.tips[i], headers: { Accept: "text/csv" } });
            save(`${tip.tooling}-FRF.csv`, await answer.text(), "text/csv");
          } catch (error) {
            failed(place, error);
          }
        },
      },
      one ? "FRF.csv" : `${tip.tooling}.csv`,
    ),
  );
  return card(
    "Tooltip FRF",
    csv,
    h(
      "div",
      { class: "row-of-buttons" },
      choices(
        "Parts",
        [
          ["polar", "Magnitude, phase"],
          ["cartesian", "Real, imaginary"],
        ],
        parts,
        (value) => {
          parts = value;
          draw();
        },
      ),
      axes.length > 1
        ? choices("Directions", [["both", "X and Y"], ...axes.map((a) => [a, a]), ...(crossed.length ? [["across", "Across"]] : [])], shown, (value) => {
            shown = value;
            draw();
          })
        : null,
    ),
    legend(keys),
    picture,
    h(
      "p",
      { class: "small soft" },
      "Shaded: 95 % band.",
      crossed.length ? " XY: motion in X under a force in Y." : null,
      rpm ? ` At ${plain(rpm)} rev/min, the middle of the speeds that were cut: it changes with the speed, and the lobes take each speed's own.` : null,
    ),
    place,
  );
}

function comparison(found, summaries, question) {
  const rows = found.lobes.map((lobes, i) => ({
    lobes,
    i,
    stickout: summaries[i]?.stickout_mm ?? null,
    best: recommended(found, i)[0] ?? null,
    pocket: lobes.best_speeds[0] ?? null,
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
    column("Highest limit at", "speed", (r) => r.pocket?.spindle_speed_rpm),
    limit("stability limit", (r) => r.pocket),
    column("Recommended speed", "speed", (r) => r.best?.spindle_speed_rpm),
    column("recommended depth", "depth", (r) => r.best?.recommended_depth_mm),
    limit("stability limit", (r) => r.best),
    column("Removes", "removal", (r) => r.best?.removal_rate_cm3_per_min),
  ];
  const box = card("Side by side", null, table("Toolings side by side", columns, rows), reserve(found, question));
  box.classList.add("wide");
  return box;
}

function lobesCsv(lobes) {
  const head = ["tooling", "spindle_speed_rpm", "limit_depth_mm", "chatter_frequency_hz", "lobe"];
  const lines = [[...head, "limit_depth_low_mm", "limit_depth_high_mm", "recommended_depth_mm"].join(",")];
  for (const each of lobes) {
    each.spindle_speed_rpm.forEach((rpm, k) =>
      lines.push(
        [
          each.tooling,
          rpm,
          each.limit_depth_mm[k],
          each.chatter_frequency_hz[k],
          each.lobe[k],
          each.limit_depth_low_mm?.[k],
          each.limit_depth_high_mm?.[k],
          each.recommended_depth_mm[k],
        ]
          .map((v) => v ?? "")
          .join(","),
      ),
    );
  }
  return `${lines.join("\n")}\n`;
}
