// Modes with their uncertainties, and what the data could not tell.
import { card, h, mark, note, table } from "../dom.js";
import { plain, significant } from "../units.js";
import { beforeAndAfter, withSpread } from "./spreads.js";

const within = (mode, band) => mode.natural_frequency_hz >= band[0] && mode.natural_frequency_hz <= band[1];
const size = (pair) => Math.hypot(...pair);

/** How X and Y feel each other, where they do. */
export function coupling(modes) {
  const words = modes.both_planes?.in_words;
  return words ? note("", `${words}.`) : null;
}

/** Card of what was learned beyond the modes: warming, and forces and joints that differ from the campaign. */
export function learned(modes) {
  if (!modes.learned.length) return null;
  const box = card(
    "Learned beyond the modes",
    null,
    h(
      "ul",
      null,
      modes.learned.map((each) => h("li", null, each)),
    ),
    h("p", { class: "small soft" }, "Modes, tooltip FRFs and limits hold for the warm machine, or for the machine as warm as in its cuts: each answer names its state."),
  );
  box.classList.add("wide");
  return box;
}

const outside = (rows, band) =>
  rows.some(({ mode }) => !within(mode, band))
    ? h("p", { class: "small soft" }, `Outside: not in the band that the cuts excited, ${plain(band[0])} to ${plain(band[1])} Hz.`)
    : null;

const misfit = (found) => (found.misfit_per_point === null ? "" : significant(found.misfit_per_point, 3));

/** The card of both directions, where they feel each other. */
function togetherCard(modes) {
  const rows = modes.both_planes.modes.map((mode, i) => ({ mode, i }));
  const axes = Object.entries(modes.axes);
  const told = axes.filter(([, found]) => misfit(found)).map(([axis, found]) => `${axis} ${misfit(found)}`);
  return card(
    "Modes, X and Y together",
    told.length ? h("span", { class: "soft small" }, `misfit per point ${told.join(", ")}`) : null,
    table("Modes of both directions", [...columns(modes.band_hz), DIRECTION], rows, {
      row: ({ mode }) => ({ class: within(mode, modes.band_hz) ? null : "soft" }),
    }),
    outside(rows, modes.band_hz),
    h(
      "p",
      { class: "small soft" },
      "Direction: of the line along which a mode moves the flange, from +X towards +Y. The spindle at standstill",
      modes.both_planes.gyroscopic ? "; gyroscopic moments, which grow with its speed, are in everything that is computed with the machine." : ".",
    ),
    joint(axes[0][1].joint),
  );
}

const DIRECTION = { name: "Direction", unit: "°", number: true, cell: ({ mode }) => plain(mode.direction_deg) };

const sizeOf = (translation) => ({
  name: "Translation",
  unit: "10⁻³ √(s/kg)",
  number: true,
  cell: ({ mode }) => significant(translation(mode) * 1e3, 3),
});

const columns = (band) => [
  {
    name: "Mode",
    cell: (r) => [String(r.i + 1), within(r.mode, band) ? null : h("span", { class: "soft small" }, " outside")],
  },
  { name: "Frequency", unit: "Hz", number: true, cell: ({ mode }) => withSpread(mode.natural_frequency_hz, mode.natural_frequency_std_hz) },
  { name: "Damping", unit: "%", number: true, cell: ({ mode }) => withSpread(mode.damping_ratio, mode.damping_ratio_std, 100) },
];

/** A card for each axis, or one for both where they feel each other; then what gives way on the workpiece's side, where somebody looked. */
export const modesCards = (modes) => [...spindleCards(modes), ...validationCard(modes), ...workpieceCard(modes)];

const percent = (share) => significant(100 * share, 2);
const PREDICTED = [
  { name: "Tooling", cell: ({ tooling }) => tooling },
  { name: "Axis", cell: ({ axis }) => axis },
  { name: "Error of its lines", unit: "%", number: true, cell: ({ found }) => percent(found.error) },
  { name: "Promised", unit: "%", number: true, cell: ({ found }) => percent(found.promised) },
];

function validationCard(modes) {
  const rows = Object.entries(modes.axes).flatMap(([axis, { validation }]) =>
    Object.entries(validation ?? {}).map(([tooling, found]) => ({ tooling, axis, found })),
  );
  if (!rows.length) return [];
  return [
    card(
      "Validation",
      null,
      table("Predicted lines", PREDICTED, rows),
      h("p", { class: "small soft" }, "The answer without a tooling predicts that tooling's lines. Bands and noise make the promise."),
    ),
  ];
}

const SIDE = [
  { name: "Axis", cell: ({ axis }) => axis },
  ...[
    ["Frequency", "Hz", "natural_frequency_hz", "natural_frequency_std_hz", 1],
    ["Damping", "%", "damping_ratio", "damping_ratio_std", 100],
    ["Stiffness", "N/µm", "stiffness_n_per_m", "stiffness_std_n_per_m", 1e-6],
  ].map(([name, unit, key, std, times]) => ({ name, unit, number: true, cell: ({ mode }) => withSpread(mode[key], mode[std], times) })),
];

function workpieceCard(modes) {
  const axes = Object.entries(modes.workpiece_side ?? {});
  if (!axes.length) return [];
  const rows = axes.flatMap(([axis, found]) => found.modes.map((mode) => ({ axis, mode })));
  const seen = ([axis, { sensor, role, lines, modes }]) =>
    `${axis}: ${sensor} on the ${role}, ${lines} lines${modes.length ? "" : ", nothing above the noise"}.`;
  return [
    card(
      "Workpiece's side of the cut",
      null,
      rows.length ? table("Modes of the workpiece's side", SIDE, rows) : null,
      h("p", { class: "small soft" }, axes.map(seen).join(" "), " Lobes hold for tool and workpiece together, a tip FRF is the tool's alone."),
    ),
  ];
}

function spindleCards(modes) {
  if (modes.both_planes) return [togetherCard(modes)];
  const cards = Object.entries(modes.axes).map(([axis, found]) => {
    const rows = found.modes.map((mode, i) => ({ mode, i }));
    return card(
      `Modes, ${axis} direction`,
      misfit(found) ? h("span", { class: "soft small" }, `misfit per point ${misfit(found)}`) : null,
      table(
        `Modes in ${axis}`,
        [...columns(modes.band_hz), sizeOf((mode) => size(mode.phi_t))],
        rows,
        { row: ({ mode }) => ({ class: within(mode, modes.band_hz) ? null : "soft" }) },
      ),
      outside(rows, modes.band_hz),
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

/** What the cuts taught of toolings whose drawings are not exact; what they hardly taught stands behind it. */
export function drawings(modes) {
  if (!modes.toolings?.length) return null;
  const columns = [
    { name: "Tooling", cell: (r) => r.toolings.join(", ") },
    ...beforeAndAfter("Drawn", (r) => [r.drawn, r.spread], "Found", (r) => [r.found, r.deviation]),
  ];
  const [taught, hardly] = [false, true].map((wanted) => modes.toolings.filter((r) => r.hardly_taught === wanted));
  const box = card(
    "Toolings, as drawn and as found",
    null,
    taught.length ? table("Toolings, as drawn and as found", columns, taught) : h("p", null, "The cuts taught hardly anything of them."),
    hardly.length
      ? h("details", null, h("summary", null, `What the cuts hardly taught: ${hardly.length}`), table("Hardly taught", columns, hardly))
      : null,
  );
  box.classList.add("wide");
  return box;
}

/** What could not be told is as much of an answer as what could. */
export function notes(modes) {
  const told = modes.notes.filter((each) => each !== modes.both_planes?.in_words);
  if (!told.length) return null;
  const box = card(
    "What the cuts could not tell",
    mark("idle", `${told.length}`),
    note(
      "",
      h(
        "ul",
        null,
        told.map((each) => h("li", null, each)),
      ),
    ),
  );
  box.classList.add("wide");
  return box;
}
