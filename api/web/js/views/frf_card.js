// The tooltip FRFs of a tool change, with their bands.
import { send } from "../api.js";
import { chart, legend, SERIES } from "../charts.js";
import { card, choices, h, save } from "../dom.js";
import { across, frfFigure } from "../figures.js";
import { failed } from "../forms.js";

/** The card; `look` says which parts and directions are shown, `look.keep()` that this has changed. */
export function frfCard(found, body, look) {
  const picture = chart("Tooltip FRF", "frf");
  const known = ["both", ...Object.keys(found.tips[0].axes), ...(across(found.tips[0]).length ? ["across"] : [])];
  const shown = () => (known.includes(look.shown) ? look.shown : "both");
  const draw = () => picture.draw(() => frfFigure(found.tips, { parts: look.parts, shown: shown() }));
  draw();
  const axes = Object.keys(found.tips[0].axes);
  const one = found.tips.length === 1;
  const crossed = across(found.tips[0]).map(([name]) => name);
  const { spindle_speed_rpm: rpm, state } = found.tips[0];
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
        look.parts,
        (value) => {
          look.parts = value;
          look.keep();
          draw();
        },
      ),
      axes.length > 1
        ? choices("Directions", [["both", "X and Y"], ...axes.map((a) => [a, a]), ...(crossed.length ? [["across", "Across"]] : [])], shown(), (value) => {
            look.shown = value;
            look.keep();
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
      state ? ` For: ${state}.` : null,
      rpm ? " This is the middle of the speeds that were cut: the machine changes with the speed, and the lobes take each speed's own." : null,
    ),
    place,
  );
}
