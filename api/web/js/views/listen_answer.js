// What a recording says, in words first, then drawn.
import { chart, legend } from "../charts.js";
import { card, h, mark, note, sentence } from "../dom.js";
import { orderFigure, signalFigure, spectrogramFigure } from "../listen_figures.js";
import { plain, significant } from "../units.js";

const KINDS = { stable: "good", chatter: "bad", idle: "idle", "no cut": "idle", unsteady: "doubt" };
const SAID = {
  stable: "The cut is stable",
  chatter: "The cut chatters",
  idle: "The spindle turns, and nothing is cut",
  "no cut": "No cut is heard",
  unsteady: "The speed is not steady",
};
/** Files that leave out what ears do not miss. */
const LOSSY = /\.(mp3|ogg|oga|opus|m4a|aac|wma)$/i;

export function listenAnswer(found, file) {
  const drawn = pictures(found);
  return [
    headline(found),
    LOSSY.test(file.name)
      ? note("doubt", "This file is compressed with losses: its frequencies hold, but how fast a line decays does not. Nothing is said of damping; WAV or FLAC keep everything.")
      : null,
    card("What was found", null, facts(found), h("ul", null, found.reasons.map((each) => h("li", null, sentence(each))))),
    ...drawn,
  ];
}

/** The verdict in a line. */
export const said = (found) => `${SAID[found.verdict]}${found.spindle_speed_rpm === null ? "" : `, at ${plain(found.spindle_speed_rpm)} rev/min`}`;

function headline(found) {
  const [chatter] = found.chatter_frequencies_hz;
  const speed = found.spindle_speed_rpm;
  const figures = [
    speed === null ? null : figure("spindle ", plain(speed, 1, 1), " rev/min"),
    chatter === undefined ? null : figure("chatter ", plain(chatter, 1, 1), " Hz"),
  ].filter(Boolean);
  return h(
    "article",
    { class: "best heard", dataset: { verdict: found.verdict } },
    h("h2", null, SAID[found.verdict], mark(KINDS[found.verdict], found.verdict)),
    figures.length ? h("p", { class: "set" }, figures) : null,
    found.verdict === "chatter" ? next(found) : null,
    h("p", { class: "small soft" }, found.recording),
  );
}

const figure = (before, number, unit) =>
  h("span", { class: "figure" }, h("span", { class: "of" }, before), h("output", null, number), h("span", { class: "of" }, unit));

/** The speed to try, and why. */
function next(found) {
  const [first, ...others] = found.suggested_speeds_rpm;
  const [chatter] = found.chatter_frequencies_hz;
  if (first === undefined)
    return h(
      "p",
      null,
      found.chatter_aliases_hz.length > 1
        ? `No speed is advised: the recorder cannot tell ${found.chatter_aliases_hz.map((f) => plain(f)).join(", ")} Hz apart. Record with a higher sampling rate.`
        : found.teeth === null
          ? "Tell how many teeth the cutter has, and listen again: then a speed to try is told."
          : "No speed of this range fits the chatter.",
    );
  const waves = (rpm) => Math.round((60 * chatter) / (found.teeth * rpm));
  const words = (rpm) => (waves(rpm) === 1 ? "one wave" : `${waves(rpm)} waves`);
  return h(
    "div",
    { class: "try" },
    h("p", { class: "set" }, figure("try next ", plain(first), " rev/min")),
    h(
      "p",
      null,
      `At that speed ${words(first)} of the chatter fit exactly between two teeth, so each tooth cuts along the wave that the last one left.`,
      others.length ? ` If the machine does not reach it, or the tool may not turn so fast: ${others.map((rpm) => `${plain(rpm)} (${words(rpm)})`).join(", ")} rev/min.` : "",
      " Fewer waves give more room.",
    ),
    h("p", { class: "small soft" }, "How deep one may cut there, the sound does not tell. Begin with less, and listen again."),
  );
}

const share = (of) => `${plain(100 * of)} %`;
const fact = (name, value, kind = null) => h("div", { class: kind }, h("dt", null, name), h("dd", null, value));

function facts(found) {
  const speed = found.spindle_speed_rpm;
  const [from, until] = found.part_s;
  return h(
    "dl",
    { class: "facts" },
    speed === null ? null : fact("Spindle speed", `${plain(speed, 1, 1)} ± ${significant(found.spindle_speed_std_rpm, 2)} rev/min`),
    found.other_speeds_rpm.length ? fact("Probability of this speed", share(found.speed_probabilities[0])) : null,
    found.other_speeds_rpm.length
      ? fact("Or else", found.other_speeds_rpm.map((each, i) => `${plain(each, 1)} rev/min (${share(found.speed_probabilities[i + 1])})`).join(", "))
      : null,
    found.chatter_probability === null ? null : fact("Probability of chatter", share(found.chatter_probability)),
    found.ramp ? fact("It changes", `${plain(found.ramp[0])} to ${plain(found.ramp[1])} rev/min`) : null,
    found.speed_wander_percent === null ? null : fact("Wander of the speed", `${significant(found.speed_wander_percent, 2)} %`),
    fact("Teeth", found.teeth === null ? "not heard" : plain(found.teeth)),
    found.explained_share === null ? null : fact("Explained by the rotation", `${plain(100 * Math.max(0, found.explained_share))} %`),
    found.chatter_frequencies_hz.length ? fact("Chatter", `${found.chatter_frequencies_hz.map((f) => plain(f, 1, 1)).join(", ")} Hz`) : null,
    found.chatter_aliases_hz.length > 1 ? fact("Or its aliases", `${found.chatter_aliases_hz.map((f) => plain(f)).join(", ")} Hz`) : null,
    fact("Judged", `${plain(from, 1, 1)} to ${plain(until, 1, 1)} s of ${plain(found.duration_s, 1, 1)} s`),
    fact("Sensor", `${found.quantity}: ${found.channels.join(", ")}`),
    found.events.length
      ? fact("Noticed", found.events.map((each) => (each.time_s === null ? each.event : `${each.event} at ${plain(each.time_s, 1, 1)} s`)).join(", "), "whole")
      : null,
  );
}

function pictures(found) {
  const { curves } = found;
  if (!curves) return [];
  const words = `${found.verdict}${found.spindle_speed_rpm === null ? "" : ` at ${plain(found.spindle_speed_rpm, 1)} rev/min`}`;
  const drawn = [
    ["Spectrum over orders of the spindle", orderFigure, "small tall", found.spindle_speed_rpm === null ? "Spectrum" : null],
    ["Spectrogram", spectrogramFigure, "small tall", null],
    ["Signal", signalFigure, "small", null],
  ];
  const teeth = found.teeth === null ? "spindle" : "tooth passages";
  return drawn.map(([title, figureOf, kind, other]) => {
    const picture = chart(`${title}: ${words}`, kind);
    picture.draw(() => ({ say: `${title}: ${words}`, ...figureOf(found) }));
    const keys = {
      Spectrogram: h("p", { class: "small soft" }, `Dotted: multiples of the ${found.teeth === null ? "spindle's frequency" : "tooth passing frequency"}. ${found.chatter_frequencies_hz.length ? "Orange: chatter." : ""}`),
      Signal: h("p", { class: "small soft" }, "Shaded: what was judged."),
    }[title] ?? legend([{ name: teeth, series: "s1", dash: "dot" }, ...(found.chatter_frequencies_hz.length ? [{ name: "chatter", series: "s2" }] : [])]);
    return card(other ?? title, null, keys, picture);
  });
}
