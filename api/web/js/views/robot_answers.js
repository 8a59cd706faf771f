// What an arm is at a posture: numbers, natural frequencies, other postures; its lobes, and the limits along a path.
import { axis, chart, colour } from "../charts.js";
import { card, fill, h, note, table } from "../dom.js";
import { lobeFigure } from "../figures.js";
import { factor, plain, q, text, unit } from "../units.js";

const SHOWN = 8;
const fact = (name, ...value) => h("div", null, h("dt", null, name), h("dd", null, value));
/** A joint's angle with as many whole turns as bring it within its limits; null where none does. */
function turned(angle, limits) {
  if (!limits) return angle;
  return [0, -360, 360].map((each) => angle + each).find((each) => each >= limits[0] - 1e-3 && each <= limits[1] + 1e-3) ?? null;
}

/** What speaks against posture and description: in short where it is much. */
function doubts(warnings) {
  if (warnings.length < 2) return warnings.length ? note("doubt", ...warnings) : null;
  const list = h("ul", null, warnings.map((each) => h("li", null, each)));
  return note("doubt", h("details", null, h("summary", null, `${warnings.length} doubts about posture and description`), list));
}

/** The card of a posture; `onpick(angles)` takes another posture of the same place. */
export function postureCard(found, joints, angles, onpick) {
  const c = found.tcp_compliance_m_per_n;
  const axisOf = (k) => found.tcp_axes.map((row) => row[k]);
  const facts = h(
    "dl",
    { class: "facts" },
    ["x", "y", "z"].map((name, k) => fact(`Tool point ${name}`, q("length", 1e3 * found.tcp_m[k], { digits: 1 }))),
    ["x", "y", "z"].map((name, k) => fact(`Gives way along ${name}`, q("receptance", c[k][k], { digits: 3 }))),
    found.natural_frequencies_hz.length ? fact("Lowest frequency", `${plain(found.natural_frequencies_hz[0], 2, 2)} Hz`) : null,
    found.mass_kg === null ? fact("Mass", "not known") : fact("Mass", `${plain(found.mass_kg)} kg`),
    fact("Tool points along", axisOf(2).map((v) => plain(Math.round(100 * v) / 100 + 0, 2, 2)).join(", ")),
  );
  const others = found.postures_deg
    .map((each) => each.map((angle, k) => turned(angle, joints[k].limits_deg)))
    .filter((each) => each.every((v) => v !== null) && each.some((v, k) => Math.abs(((v - angles[k] + 540) % 360) - 180) > 0.05));
  const box = card(
    "At this posture",
    null,
    doubts(found.warnings),
    facts,
    others.length
      ? h(
          "div",
          null,
          h("h3", null, "Other postures of the same place"),
          h(
            "div",
            { class: "postures" },
            others.map((each) => h("button", { type: "button", onclick: () => onpick(each) }, each.map((v) => `${plain(v, 1)}°`).join(" "))),
          ),
        )
      : null,
  );
  return box;
}

/** The card of natural frequencies; nothing where masses are not known. */
export function modesCard(found) {
  if (!found.natural_frequencies_hz.length)
    return card("Natural frequencies", null, h("p", { class: "soft" }, "No masses are known of this arm: it has postures and stiffness alone."));
  const rows = found.natural_frequencies_hz.slice(0, SHOWN).map((hz, k) => ({ hz, zeta: found.damping_ratios[k] }));
  const more = found.natural_frequencies_hz.length - rows.length;
  return card(
    "Natural frequencies",
    null,
    table(
      "Natural frequencies of the arm",
      [
        { name: "Mode", cell: (_, k) => String(k + 1) },
        { name: "Frequency", unit: "Hz", number: true, cell: (r) => plain(r.hz, 2, 2) },
        { name: "Damping", unit: "%", number: true, cell: (r) => plain(100 * r.zeta, 2, 2) },
      ],
      rows,
    ),
    more > 0 ? h("p", { class: "small soft" }, `${more} more up to ${plain(found.natural_frequencies_hz.at(-1))} Hz.`) : null,
    h(
      "p",
      { class: "small soft" },
      "Torques of the drives against the weight: ",
      found.gravity_torque_nm.map((v, k) => [k ? ", " : "", q("torque", v, { digits: 0, bare: true })]),
      ` ${unit("torque")}.`,
    ),
  );
}

/** The lobes of a posture: `box`, `show(lobes, deepest)`. */
export function postureLobes() {
  const picture = chart("Stability lobes at this posture", "lobes", "");
  const words = h("p", { "aria-live": "polite" });
  const box = card("Stability lobes at this posture", null, words, picture, h("p", { class: "small soft" }, "By zero order; they follow the posture. The feed runs along the tool's x."));
  box.classList.add("wide");
  box.hidden = true;
  const show = (lobes, deepest) => {
    box.hidden = false;
    const best = lobes.best_speeds[0];
    const depth = (value) => (value === null ? ["above ", q("depth", deepest)] : q("depth", value));
    fill(
      words,
      "Stable at any speed up to ",
      depth(lobes.absolute_limit_mm),
      best ? [`; highest limit at ${plain(best.spindle_speed_rpm)} rev/min, `, depth(best.limit_depth_mm)] : null,
      lobes.absolute_frequency_hz === null ? null : `; the lowest limit chatters at ${plain(lobes.absolute_frequency_hz, lobes.absolute_frequency_hz < 100 ? 1 : 0)} Hz`,
      ".",
    );
    picture.draw((plot) => lobeFigure([lobes], { maxDepth: deepest, removal: [null] }, plot));
  };
  return { box, show };
}

/** The limits along a path at the speed that suits all of it, and at the worst one. */
export function mapCard(found, deepest) {
  const picture = chart("Limits along the path", "small tall");
  const best = found.spindle_speed_rpm.indexOf(found.best_speed_rpm);
  const shown = (value) => (value ?? deepest) * factor("depth");
  const everywhere = found.limit_everywhere_mm;
  const box = card(
    "Limits along the path",
    null,
    h(
      "p",
      null,
      `At ${plain(found.best_speed_rpm)} rev/min every place is stable up to `,
      everywhere === null ? ["more than ", q("depth", deepest)] : q("depth", everywhere),
      ".",
    ),
    picture,
    h("p", { class: "small soft" }, "Line: at that speed. Dotted: the lowest limit of all speeds that were asked for."),
  );
  box.classList.add("wide");
  const places = found.limit_depth_mm.map((_, k) => k + 1);
  const draw = () =>
    picture.draw(() => {
      const line = (values, dash, words) => ({
        x: places, y: values, type: "scatter", mode: "lines+markers", marker: { size: 5, color: colour("s1") }, line: { color: colour("s1"), width: 2, dash },
        hovertemplate: `place %{x}: ${words} %{y:.3~g} ${unit("depth")}<extra></extra>`,
      });
      return {
        data: [
          line(found.limit_depth_mm.map((row) => shown(row[best])), "solid", `${plain(found.best_speed_rpm)} rev/min`),
          line(found.limit_depth_mm.map((row) => Math.min(...row.map(shown))), "dot", "any speed"),
        ],
        layout: { xaxis: axis("Place along the path", { tickformat: ",d" }), yaxis: axis(`Axial depth [${unit("depth")}]`, { rangemode: "tozero" }) },
        say: `Limits along the path of ${places.length} places; everywhere ${everywhere === null ? "none" : text("depth", everywhere)}.`,
      };
    });
  return { box, draw };
}
