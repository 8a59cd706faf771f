// The stability lobes of a tool change: the chart, a speed to read it at, cuts that were tried.
import { chart, legend, SERIES } from "../charts.js";
import { card, fill, h, save } from "../dom.js";
import { lobeFigure } from "../figures.js";
import { failed, quantity } from "../forms.js";
import { testedCuts, testedLegend, toldRight } from "../tested.js";
import { plain, q } from "../units.js";
import { around, isPreview, limitOf, recommended } from "./headline.js";

/** Limits that hold at a speed: those around a recommended cut where there are some, else the lobes. */
const holding = (found, i, rpm) =>
  (around(found, i) ?? []).find((each) => each.spindle_speed_rpm[0] <= rpm && rpm <= each.spindle_speed_rpm.at(-1)) ?? found.lobes[i];

function at(lobes, rpm) {
  const speeds = lobes.spindle_speed_rpm;
  let k = 0;
  speeds.forEach((each, i) => {
    if (Math.abs(each - rpm) < Math.abs(speeds[k] - rpm)) k = i;
  });
  return k;
}

const several = (found) => found.lobes.length > 1;

/** The card as `box`; `part(partial)` draws limits that another method has come to over those of the preview. */
export function lobesCard(found, removal, question, tested, ontested, look) {
  const picture = chart("Stability lobes", "lobes");
  const parts = [];
  const draw = () =>
    picture.draw((box) => {
      const best = found.lobes.map((_, i) => recommended(found, i)[0]);
      const close = found.lobes.map((_, i) => around(found, i) ?? []);
      const shown = { maxDepth: question.max_depth_mm, removal, recommended: best, around: close, tested: tested.cuts };
      return lobeFigure(found.lobes, { ...shown, parts: found.coming ? parts : null }, box);
    });
  draw();
  const first = found.lobes[0];
  const start = look.at ?? Math.round(recommended(found, 0)[0]?.spindle_speed_rpm ?? first.spindle_speed_rpm[0]);
  const speed = quantity("At a speed of", "speed", start);
  const read = h("ul", { class: "reads", "aria-live": "polite" });
  const show = () => {
    const rpm = speed.input.base;
    fill(
      read,
      !Number.isFinite(rpm) || rpm === null
        ? h("li", { class: "soft" }, "Write a speed.")
        : found.lobes.map(({ tooling }, i) => {
            const lobes = holding(found, i, rpm);
            const preview = isPreview(lobes);
            const k = at(lobes, rpm);
            const depth = lobes.limit_depth_mm[k];
            const low = lobes.limit_depth_low_mm?.[k];
            const high = lobes.limit_depth_high_mm?.[k];
            const chatter = lobes.chatter_frequency_hz[k];
            const deep = lobes.recommended_depth_mm?.[k] ?? null;
            return h(
              "li",
              null,
              several(found) ? h("strong", null, `${tooling}: `) : null,
              preview ? "stability limit by a preview " : "stability limit ",
              limitOf({ limit_depth_mm: depth }, question),
              low !== undefined && low !== null && high
                ? [" (95 %: ", q("depth", low, { bare: true }), " to ", q("depth", high), ")"]
                : null,
              deep === null ? null : [", recommended depth ", q("depth", deep)],
              removal[i] && deep !== null ? [" · ", q("removal", removal[i] * lobes.spindle_speed_rpm[k] * deep)] : null,
              chatter === null ? null : ` · beyond the limit chatter at ${plain(chatter)} Hz`,
              lobes.flip?.[k] ? " · period doubling" : null,
            );
          }),
    );
  };
  speed.input.addEventListener("input", () => {
    look.at = Number.isFinite(speed.input.base) ? speed.input.base : null;
    look.keep();
    show();
  });
  show();
  const csv = h(
    "button",
    { type: "button", class: "quiet", onclick: () => save("LOBES.csv", lobesCsv(found.lobes), "text/csv") },
    "LOBES.csv",
  );
  const { choose, beside, fault } = testedParts(found.lobes, tested, ontested);
  const method = found.coming ?? first.method;
  const by = found.advice?.[0]?.recommended_by;
  const lines = several(found) ? found.lobes.map((l, i) => ({ name: l.tooling, series: SERIES[i % SERIES.length] })) : [];
  if (found.coming) {
    const series = several(found) ? "s6" : SERIES[0];
    lines.push({ name: `${found.coming}, as far as it is known`, series }, { name: `preview by ${first.method}`, series, dash: "dot" });
  }
  const box = card(
    method === "zero-order" ? "Stability lobes" : `Stability lobes, ${method}`,
    [choose, csv],
    fault,
    lines.length ? legend(lines) : null,
    picture,
    beside,
    h(
      "p",
      { class: "small soft" },
      isPreview(first)
        ? `Dotted: a preview by ${first.method}. Solid, around the recommended cuts: the stability limit${by ? ` by ${by}` : ""}. `
        : "The line is the stability limit. Diamonds: the highest limits. ",
      "Shaded: where the limit lies with a probability of 95 %. Dot: the recommended cut. Hover for limit and chatter frequency; drag to look closer.",
    ),
    h("div", { class: "reader" }, speed, read),
  );
  const part = (partial) => {
    parts[partial.index] = partial;
    draw();
  };
  return { box, part };
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
        ontested({ name: file.name, ...(await testedCuts(file.name, file)) });
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
  told.push(...(tested.warnings ?? []).map((warning) => h("li", null, warning)));
  return { choose, beside: h("div", { class: "tested-cuts" }, testedLegend(tested.cuts), away, h("ul", { class: "reads" }, told)), fault };
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
