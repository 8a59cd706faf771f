// Modes with their uncertainties, and what the data could not tell.
import { card, h, mark, note, table } from "../dom.js";
import { plain, significant } from "../units.js";

const within = (mode, band) => mode.natural_frequency_hz >= band[0] && mode.natural_frequency_hz <= band[1];
const size = (pair) => Math.hypot(...pair);

/** A number with its standard deviation, both cut where the deviation says that digits end. */
export function withSpread(value, spread, times = 1) {
  if (spread === null || spread === undefined) return significant(value * times, 4);
  const place = spread > 0 ? Math.max(0, 1 - Math.floor(Math.log10(spread * times))) : 3;
  const digits = Math.min(place, 6);
  return h(
    "span",
    { class: "nowrap" },
    plain(value * times, digits, digits),
    h("span", { class: "soft" }, ` ± ${plain(spread * times, digits, digits)}`),
  );
}

/** A card for each axis. */
export function modesCards(modes) {
  const cards = Object.entries(modes.axes).map(([axis, found]) => {
    const rows = found.modes.map((mode, i) => ({ mode, i }));
    return card(
      `Modes, ${axis} direction`,
      found.misfit_per_point === null
        ? null
        : h("span", { class: "soft small" }, `misfit per point ${significant(found.misfit_per_point, 3)}`),
      table(
        `Modes in ${axis}`,
        [
          {
            name: "Mode",
            cell: (r) => [String(r.i + 1), within(r.mode, modes.band_hz) ? null : h("span", { class: "soft small" }, " outside")],
          },
          {
            name: "Frequency",
            unit: "Hz",
            number: true,
            cell: ({ mode }) => withSpread(mode.natural_frequency_hz, mode.natural_frequency_std_hz),
          },
          { name: "Damping", unit: "%", number: true, cell: ({ mode }) => withSpread(mode.damping_ratio, mode.damping_ratio_std, 100) },
          { name: "Translation", unit: "10⁻³ √(s/kg)", number: true, cell: ({ mode }) => significant(size(mode.phi_t) * 1e3, 3) },
        ],
        rows,
        { row: ({ mode }) => ({ class: within(mode, modes.band_hz) ? null : "soft" }) },
      ),
      rows.some(({ mode }) => !within(mode, modes.band_hz))
        ? h(
            "p",
            { class: "small soft" },
            `Outside: not in the band that the cuts excited, ${plain(modes.band_hz[0])} to ${plain(modes.band_hz[1])} Hz.`,
          )
        : null,
      joint(found.joint),
    );
  });
  return cards;
}

function joint(values) {
  const rows = [
    ["translational_stiffness", "N/m"],
    ["rotational_stiffness", "N m/rad"],
    ["translational_damping", "N s/m"],
    ["rotational_damping", "N m s/rad"],
  ];
  return h(
    "details",
    null,
    h("summary", null, "Joint between spindle and tool-holder"),
    h(
      "dl",
      { class: "facts" },
      rows
        .filter(([name]) => name in values)
        .map(([name, unit]) =>
          h(
            "div",
            null,
            h("dt", null, name.replace("_", " ")),
            h("dd", null, significant(values[name], 3), h("span", { class: "soft small" }, ` ${unit}`)),
          ),
        ),
    ),
  );
}

/** What could not be told is as much of an answer as what could. */
export function notes(modes) {
  if (!modes.notes.length) return null;
  return card(
    "What the cuts could not tell",
    mark("idle", `${modes.notes.length}`),
    note(
      "",
      h(
        "ul",
        null,
        modes.notes.map((each) => h("li", null, each)),
      ),
    ),
  );
}
