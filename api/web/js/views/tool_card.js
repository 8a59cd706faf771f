// The tool card: a tooling's recommended cuts on one page of A4, for those who stand at the machine.
import { described, get, part, post } from "../api.js";
import { add, empty, h, head, link, note, table, waiting } from "../dom.js";
import { libraryDrawing } from "../drawing.js";
import { widthOf } from "../figures.js";
import { followLobes } from "../jobs.js";
import { to } from "../router.js";
import { plain, q, u } from "../units.js";
import { bodyOf, NUMBERS, QUICK, runoutOf } from "./change_question.js";
import { heldBack, limitOf } from "./headline.js";

export async function view(_args, query, place) {
  const [name, id] = [query.get("tooling") ?? "", query.get("machine") ?? ""];
  const leaving = new AbortController();
  const back = link(to("change", Object.fromEntries(query)), "Back to the lobes", "button");
  add(
    place,
    head(`Tool card: ${name}`, null, h("button", { type: "button", class: "primary", onclick: () => window.print() }, "Print"), back),
  );
  if (!name || !id)
    return void add(place, empty("No tooling is chosen", "A card belongs to a tooling on a machine.", link(to("change"), "Choose one", "button primary")));
  const late = waiting("computing the recommended cuts …");
  add(place, late);
  const [machine, kept, { info }, versions] = await Promise.all([
    get(`machines/${part(id)}`),
    get(`toolings/${part(name)}`),
    described(),
    Promise.all([versionOf("tooling", name), versionOf("identification", id)]),
  ]);
  const question = questionOf(query, id, name);
  const found = await answered(question, leaving.signal);
  late.remove();
  add(place, sheet({ name, machine, keys: kept.tooling, question: question.lobes, found, software: info.version, versions }));
  return () => leaving.abort();
}

/** The question that an address asks, with the defaults of the view that it comes from. */
function questionOf(query, id, name) {
  const given = (key, usual) => (query.get(key) ? Number(query.get(key)) : usual);
  const fields = Object.fromEntries(NUMBERS.map(([key, , usual]) => [key, { input: { base: given(key, usual) } }]));
  fields.runout = { input: { base: runoutOf(query) } };
  return bodyOf({ machine: id }, [name], fields, {
    stock: query.get("stock") ?? "",
    strategy: query.get("st") ?? "down",
    direction: query.get("fd") ?? "+X",
    method: query.get("method") ?? QUICK,
    material: query.get("material") ?? "",
    tested: [],
  });
}

/** Recommended cuts, their warnings, and what computed them. */
async function answered({ lobes, advice }, signal) {
  if (advice) {
    const [told] = (await post("advice", advice, { signal })).toolings;
    return { ...told, cuts: told.highest_removal, lowest: told.lowest_limit_mm };
  }
  const [told] = (await followLobes(lobes, signal, () => {})).toolings;
  return { ...told, cuts: told.recommended, lowest: told.absolute_limit_mm };
}

async function versionOf(kind, name) {
  const [last] = (await get(`changes?kind=${kind}&name=${part(name)}&limit=1`)).items;
  return last ? `version ${last.version} of ${new Date(last.created).toLocaleDateString()}` : "";
}

function sheet({ name, machine, keys, question, found, software, versions }) {
  const { cut, speeds } = question;
  const [ofTooling, ofMachine] = versions;
  // a flange that was measured is taken for exact
  const ofRecords = machine.identification?.status === "measured" ? "" : " that holds with a probability of 95 %";
  return h(
    "article",
    { class: "card tool-card" },
    h("div", { class: "picture" }, libraryDrawing(name)),
    h("h2", null, "Recommended cuts"),
    found.cuts.length ? cutsTable(found.cuts, keys, question) : note("doubt", found.withheld ?? "No cut is recommended at these speeds."),
    heldBack(found.cuts.find((cut) => cut.held_back)),
    h(
      "p",
      { class: "small" },
      `The recommended depth stays 10 % below the stability limit${ofRecords}, with the speed right within 1 %.`,
      found.recommended_by ? ` Computed by ${found.recommended_by}.` : null,
      found.lowest === null ? null : [" Stable at any of the speeds below ", q("depth", found.lowest), "."],
      found.band?.in_words ? ` First cut: ${found.band.in_words}.` : null,
    ),
    found.warnings.length ? note("doubt", h("strong", null, "Mind"), h("ul", null, found.warnings.map((each) => h("li", null, each)))) : null,
    h("h2", null, "Conditions"),
    facts([
      ["Machine", machine.name],
      ...(cut.stock === "block"
        ? [["Stock", ["a block from ", q("length", cut.y_from_mm, { digits: 2 }), " to ", q("length", cut.y_to_mm, { digits: 2 }), " beside the path"]]]
        : [
            ["Strategy", cut.strategy === "up" ? "up milling" : "down milling"],
            ["Radial immersion", [`${plain(100 * cut.immersion, 1)} %, `, q("length", widthOf(cut, keys.cutter.diameter_mm), { digits: 2 }), " wide"]],
          ]),
      ["Feed per tooth", cut.feed_per_tooth_mm === undefined ? "not given" : q("feed", cut.feed_per_tooth_mm)],
      ["Feed direction", cut.feed_direction.replace("-", "−")],
      ["Material", cut.material ?? (cut.ktc_mpa ? q("pressure", cut.ktc_mpa) : "as in the identification")],
      ["Speeds asked for", `${plain(speeds.from_rpm)} to ${plain(speeds.to_rpm)} rev/min`],
    ]),
    h("h2", null, "Tooling"),
    facts([
      ["Teeth", String(keys.cutter.teeth)],
      ["Cutting diameter", q("length", keys.cutter.diameter_mm, { digits: 1 })],
      ["Helix", `${[keys.cutter.helix_deg ?? 0].flat().map((each) => plain(each, 1)).join(" / ")}°`],
      ["Stickout", q("length", keys.tool.stickout_mm, { digits: 1 })],
      ["Insertion", q("length", keys.holder.insertion_mm, { digits: 1 })],
    ]),
    h(
      "p",
      { class: "small soft" },
      [
        new Date().toLocaleString(),
        ofTooling && `tooling ${ofTooling}`,
        machine.identification && `identification ${machine.identification.status}${ofMachine ? `, ${ofMachine}` : ""}`,
        `rcsa-ident ${software}`,
      ]
        .filter(Boolean)
        .join(" · "),
    ),
  );
}

const facts = (rows) =>
  h(
    "dl",
    { class: "facts" },
    rows.map(([name, value]) => h("div", null, h("dt", null, name), h("dd", null, value))),
  );

function cutsTable(cuts, keys, question) {
  const feed = question.cut.feed_per_tooth_mm;
  const column = (name, kind, value) => ({ name, unit: u(kind), number: true, cell: (c) => q(kind, value(c) ?? null, { bare: true }) });
  return table(
    "Recommended cuts",
    [
      column("Speed", "speed", (c) => c.spindle_speed_rpm),
      column("Recommended depth", "depth", (c) => c.recommended_depth_mm),
      { name: "Stability limit", unit: u("depth"), number: true, cell: (c) => limitOf(c, question, { bare: true }) },
      ...(feed === undefined
        ? []
        : [{ name: "Feed", unit: u("feed_rate"), number: true, cell: (c) => q("feed_rate", feed * keys.cutter.teeth * c.spindle_speed_rpm, { bare: true }) }]),
      ...(cuts[0].power_kw === undefined
        ? []
        : [
            column("Removes", "removal", (c) => c.removal_rate_cm3_per_min),
            column("Power", "power", (c) => c.power_kw),
            column("Torque", "torque", (c) => c.torque_nm),
          ]),
    ],
    cuts,
  );
}
