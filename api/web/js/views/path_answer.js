// What a tool has done along a path: the part in colours, the tool at a place of the path, and the lines that were worst.
import { send } from "../api.js";
import { card, choices, fill, h, note, save, table } from "../dom.js";
import { busy, failed } from "../forms.js";
import { partPicture } from "../part_picture.js";
import { plain, q, text, u } from "../units.js";
import { coloursOf, scaleOf } from "./path_colours.js";

/** Lines of the program that the table of the worst ones has. */
const WORST = 12;
const TABLES = { removal: "ENGAGEMENT.csv", stability: "STABILITY.csv", milling: "FORCES.csv" };
/** Column, words and how its numbers are told. */
const NUMBERS = [
  ["line", "Line of the program", (v) => (v ? plain(v) : "–")],
  ["depth_mm", "Depth", (v) => q("depth", v)],
  ["margin", "Margin to chatter", (v, row) => marginOf(v, row("margin_low"))],
  ["limit_depth_mm", "Limit", (v) => (v === null ? "none found" : q("depth", v))],
  ["chatter_frequency_hz", "Chatter at", (v) => q("hertz", v)],
  ["peak_force_n", "Force", (v) => q("force", v)],
  ["deflection_um", "Deflection", (v) => q("displacement", v)],
  ["swing_um", "Vibration", (v) => q("displacement", v)],
  ["form_error_um", "Form error", (v) => (v === null ? "no wall" : q("displacement", v))],
  ["removed_volume_mm3", "Taken out", (v) => (v === null ? "–" : `${plain(v, 2)} mm³`)],
];

function marginOf(value, low) {
  if (value === null) return "–";
  const told = plain(value, 2, 2);
  return low === null || Math.abs(low - value) < 0.005 ? told : `${told}, at least ${plain(low, 2, 2)}`;
}

/** The cards of an answer, as nodes. */
export function pathAnswer(answer, id) {
  const { columns, path } = answer;
  const kinds = coloursOf(columns);
  const picture = partPicture();
  const scale = h("div");
  const way = path.way_mm.at(-1);
  const rowAt = finder(columns);
  const facts = h("dl", { class: "facts" });
  const slide = h("input", { type: "range", id: "path-way", min: 0, max: way, step: "any", value: 0 });
  const told = h("output", { for: "path-way" });
  let position = 0;

  function paint(kind) {
    const values = kind ? columns[kind.column] : [];
    const known = values.map((each) => (each === null ? null : kind.colour(each)));
    picture.show({ paint: (t) => known[answer.part?.rows[t]] ?? null });
    fill(scale, kind ? scaleOf(kind) : null);
  }

  function stand(at) {
    position = Math.min(way, Math.max(0, at));
    slide.value = position;
    const { place, axis, line, rapid } = placeAt(path, position);
    const k = rowAt(position);
    const value = (name) => (k === null ? null : (columns[name]?.[k] ?? null));
    picture.show({ at: { place, axis } });
    const words = `${text("length", position, { digits: 1 })} of ${text("length", way, { digits: 1 })}`;
    fill(told, words);
    slide.setAttribute("aria-valuetext", `${words}${line ? `, line ${line}` : ""}`);
    const fact = (name, ...shown) => h("div", null, h("dt", null, name), h("dd", null, shown));
    const rows = NUMBERS.filter(([name]) => name in columns && name !== "line");
    fill(
      facts,
      fact("Line of the program", line ? plain(line) : "–"),
      ["x", "y", "z"].map((name, i) => fact(name, q("length", place[i], { digits: 2 }))),
      k === null ? fact("Here", rapid ? "a rapid move" : "nothing is cut") : rows.map(([name, label, show]) => fact(label, show(value(name), value))),
    );
  }
  slide.addEventListener("input", () => stand(Number(slide.value)));
  // arrow keys go from row to row
  slide.addEventListener("keydown", (event) => {
    const direction = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -20, PageUp: 20 }[event.key];
    if (!direction || !columns.way_mm.length) return;
    event.preventDefault();
    stand(position + (direction * way) / Math.min(400, Math.max(40, columns.way_mm.length)));
  });

  picture.show({ part: answer.part, path, outline: answer.tool_outline_mm });
  paint(kinds[0]);
  const first = worstRows(answer)[0];
  stand(first === undefined ? 0 : columns.way_mm[first]);

  const fault = h("div");
  const whole = h("button", { type: "button", class: "quiet" }, TABLES[answer.kind]);
  whole.addEventListener(
    "click",
    busy(whole, async () => {
      try {
        save(TABLES[answer.kind], await (await send("GET", `paths/${id}/table`)).text(), "text/csv");
      } catch (error) {
        failed(fault, error);
      }
    }),
  );
  const pictured = card(
    "The part",
    [kinds.length > 1 ? choices("Coloured by", kinds.map((each) => [each.key, each.words]), kinds[0].key, (key) => paint(kinds.find((each) => each.key === key))) : null, whole],
    fault,
    picture.element,
    scale,
    h("div", { class: "along" }, h("label", { for: "path-way" }, "Along the path: ", told), slide),
    facts,
  );
  pictured.classList.add("part-card");
  return [summary(answer), pictured, worstCard(answer, (at) => (stand(at), slide.focus()))];
}

/** What is said of it. */
function summary(answer) {
  const volume = `${plain(answer.removed_volume_mm3)} mm³ are taken out, ${plain(answer.left_volume_mm3)} mm³ are left.`;
  const sentences = answer.kind === "removal" ? [volume] : [...answer.sentences, volume];
  const said = h("section", { class: `note ${{ stable: "good", "no cut": "doubt" }[answer.status] ?? (answer.status ? "bad" : "good")}`, "aria-label": "In short" }, sentences.map((each) => h("p", null, each)));
  if (!answer.warnings.length) return said;
  const doubts = answer.warnings.map((each) => h("li", null, each));
  return h("div", { class: "view" }, said, note("doubt", doubts.length === 1 ? answer.warnings[0] : h("details", { open: doubts.length < 4 }, h("summary", null, `${doubts.length} warnings`), h("ul", null, doubts))));
}

/** The worst row of each line of the program, the worst line first; without lines the worst rows. */
function worstRows({ columns, kind }) {
  const of = { stability: columns.margin_low, milling: columns.peak_force_n?.map((v) => -v), removal: columns.depth_mm?.map((v) => -v) }[kind] ?? [];
  const worst = new Map();
  of.forEach((value, k) => {
    const line = columns.line[k] || `row ${k}`;
    if (value !== null && !(of[worst.get(line)] <= value)) worst.set(line, k);
  });
  return [...worst.values()].sort((a, b) => of[a] - of[b]);
}

function worstCard(answer, onshow) {
  const rows = worstRows(answer).slice(0, WORST);
  if (!rows.length) return null;
  const { columns } = answer;
  const aside = answer.kind === "removal" ? [] : ["deflection_um", "limit_depth_mm", "removed_volume_mm3"];
  const shown = NUMBERS.filter(([name]) => name in columns && !aside.includes(name));
  const units = { depth_mm: "depth", chatter_frequency_hz: "hertz", peak_force_n: "force", swing_um: "displacement", form_error_um: "displacement" };
  const bare = (name, value, k) => {
    if (name in units) return value === null ? "–" : q(units[name], value, { bare: true });
    if (name === "margin") return marginOf(value, columns.margin_low[k]);
    return value === null ? "–" : plain(value, name === "line" ? 0 : 2);
  };
  const list = [
    ...shown.map(([name, label]) => ({
      name: label,
      number: name !== "line",
      unit: name in units ? u(units[name]) : name === "removed_volume_mm3" ? "mm³" : null,
      cell: (k) => bare(name, columns[name][k], k),
    })),
    { name: "Where", cell: (k) => h("button", { type: "button", class: "quiet small", "aria-label": `Show where line ${columns.line[k] || k + 1} is worst`, onclick: () => onshow(columns.way_mm[k]) }, "Show it") },
  ];
  const by = { stability: "nearest to chatter", milling: "with the largest forces", removal: "with the deepest cuts" }[answer.kind];
  return card(`Lines ${by}`, null, table(`Lines ${by}`, list, rows));
}

/** Where the tool is after so much of the way. */
function placeAt(path, at) {
  const ways = path.way_mm;
  let [low, high] = [0, ways.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (ways[middle] < at) low = middle;
    else high = middle;
  }
  const share = ways[high] > ways[low] ? Math.min(1, Math.max(0, (at - ways[low]) / (ways[high] - ways[low]))) : 1;
  const between = (rows) => rows[low].map((v, k) => v + share * (rows[high][k] - v));
  return { place: between(path.places_mm), axis: between(path.axes), line: path.line[high], rapid: path.rapid[high] };
}

/** Finds the row that the tool is in after so much of the way; null where it cuts nothing. */
function finder({ way_mm: ends, length_mm: lengths }) {
  return (at) => {
    let [low, high] = [0, ends.length - 1];
    if (high < 0 || at > ends[high] + 1e-3) return null;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (ends[middle] < at - 1e-3) low = middle + 1;
      else high = middle;
    }
    // of rows that are left out the next one told
    const before = low ? ends[low - 1] : -Infinity;
    return at >= Math.min(ends[low] - lengths[low], before + 2 * lengths[low]) - 1e-3 ? low : null;
  };
}
