// After a tool change: what is asked on the left, what it means for the cut on the right.
import { all, get, post, Problem } from "../api.js";
import { add, empty, fill, h, head, link, note, waiting } from "../dom.js";
import { busy, clearFaults, field, quantity, select, showProblem } from "../forms.js";
import { nextStep } from "../next_step.js";
import { remember, to } from "../router.js";
import { allMachines, choose, machine } from "../state.js";
import { followLobes } from "../jobs.js";
import { plain, q, text, unit } from "../units.js";
import { bodyOf, checked, methods, NUMBERS, QUICK } from "./change_question.js";
import { results } from "./change_results.js";

const MOST = 12;
/** What is folded away until an address says something of it. */
const FURTHER = ["method", "material", "deep", "ktc", "krc", "land", "dent", "power", "torque"];

export async function view(_args, query, place) {
  const [machines, toolings, { items: materials }, kinds] = await Promise.all([
    allMachines(),
    all("toolings"),
    get("materials"),
    methods(),
  ]);
  const asked = query.get("machine");
  if (asked && machines.some((m) => m.id === asked)) choose(asked);
  const here = machine();
  add(place, head("Tool change", "Tooltip FRF and stability lobes of any tooling, also one that never cut."));
  if (!here?.identification?.axes.length) return void add(place, await nextStep(here, "After that every tooling has its lobes."));
  if (!toolings.length) {
    return void add(
      place,
      empty(
        "No tooling yet",
        "Draw one, import a tool library, or drop tooling files in.",
        link(to("toolings"), "To the toolings", "button primary"),
      ),
    );
  }
  const chosen = new Set(
    query
      .getAll("tooling")
      .filter((name) => toolings.some((t) => t.name === name))
      .slice(0, MOST),
  );
  if (!chosen.size) chosen.add(toolings.at(-1).name);

  const fields = Object.fromEntries(
    NUMBERS.map(([key, kind, usual, name, , , label]) => {
      const given = query.get(key);
      return [key, quantity(label, kind, given === null || given === "" ? usual : Number(given), { name })];
    }),
  );
  const strategy = select(
    [
      ["down", "Down milling"],
      ["up", "Up milling"],
    ],
    query.get("st") ?? "down",
  );
  const direction = select(
    ["+X", "-X", "+Y", "-Y"].map((d) => [d, d.replace("-", "−")]),
    query.get("fd") ?? "+X",
  );
  const method = select(kinds, query.get("method") ?? QUICK);
  // a measured flange says nothing of a workpiece
  const measured = here.identification.status === "measured";
  const material = select(
    [["", measured ? "Choose one, or write coefficients" : "As in the identification"], ...materials.map((each) => [each.name, each.name])],
    query.get("material") ?? "",
  );
  let tested = { name: "", cuts: [] };
  const answer = h("div", { class: "change-results", "aria-live": "off" });
  const ask = h("button", { class: "primary" }, "Compute");
  const picks = toolingPicks(toolings, chosen, () => changed(true));

  // what stands behind a material of the library
  const source = h("p", { class: "small soft below" });
  const tellSource = () => {
    const found = materials.find((each) => each.name === material.value);
    const words = found && [
      q("pressure", found.ktc_mpa),
      `, radial ${plain(found.krc, 3)}, ±\u202f${plain(found.ktc_spread_percent)} %: ${found.condition} (${found.source})`,
    ];
    fill(source, words ?? null);
    source.hidden = !words;
  };

  // on a phone the answer stands higher than the conditions, which are told in a line
  const inShort = h("span", { class: "soft" });
  const conditions = h(
    "details",
    { class: "conditions", open: matchMedia("(min-width: 1100px)").matches },
    h("summary", null, h("strong", null, "Cut and speeds"), inShort),
    h(
      "fieldset",
      null,
      h("legend", { class: "unseen" }, "Cut"),
      h(
        "div",
        { class: "fields" },
        fields.im,
        field("Strategy", strategy, { name: "cut.strategy" }),
        fields.fz,
        field("Feed direction", direction, { name: "cut.feed_direction" }),
      ),
    ),
    h("fieldset", null, h("legend", { class: "unseen" }, "Speeds"), h("div", { class: "fields" }, fields.from, fields.to, fields.step)),
  );
  const form = h(
    "form",
    { class: "card change-form", novalidate: true },
    h(
      "fieldset",
      { "data-field": "toolings" },
      h("legend", null, "Toolings"),
      picks,
      h("div", { class: "fault", id: "toolings-fault", hidden: true }),
    ),
    conditions,
    h(
      "details",
      { open: measured || FURTHER.some((key) => query.has(key) && query.get(key) !== QUICK) },
      h("summary", null, "Material, spindle, method"),
      field("Material", material, { name: "cut.material" }),
      source,
      h(
        "div",
        { class: "fields" },
        fields.ktc,
        fields.krc,
        fields.power,
        fields.torque,
        fields.deep,
        field("Method", method, { name: "method" }),
        fields.land,
        fields.dent,
      ),
      h(
        "p",
        { class: "small soft" },
        "Empty coefficients are those of the material. Wear land and indentation together: process damping, which zero order leaves out.",
      ),
    ),
    ask,
  );
  add(place, h("div", { class: "change" }, form, answer));

  let running = null;
  let timer = null;
  const state = () => ({
    machine: here.id,
    tooling: [...chosen],
    st: strategy.value,
    fd: direction.value,
    method: method.value,
    material: material.value,
    ...Object.fromEntries(NUMBERS.map(([key, , usual]) => [key, fields[key].input.base === usual ? null : fields[key].input.base])),
  });
  const slow = () => method.value !== QUICK;

  async function compute() {
    remember("change", state());
    const shown = (key, kind) => `${fields[key].input.value}\u00a0${unit(kind)}`;
    fill(
      inShort,
      `${strategy.selectedOptions[0].textContent}, ${shown("im", "percent")} immersion, ${shown("fz", "feed")} per tooth, ${fields.from.input.value} to ${shown("to", "speed")}`,
    );
    running?.abort();
    running = new AbortController();
    const { signal } = running;
    clearFaults(form);
    const problem = checked(fields, chosen);
    if (problem) return void showProblem(form, problem, { focus: false });
    const late = setTimeout(() => fill(answer, waiting("computing …")), answer.childElementCount ? 400 : 0);
    try {
      const body = bodyOf(here.id, [...chosen], fields, {
        strategy: strategy.value,
        direction: direction.value,
        method: method.value,
        material: material.value,
        tested: tested.cuts,
      });
      for await (const found of answers(body, signal, answer, late)) {
        clearTimeout(late);
        if (signal.aborted) return;
        results(answer, found, { toolings, body, tested, ontested });
      }
      answer.removeAttribute("aria-busy");
    } catch (error) {
      clearTimeout(late);
      if (error.name === "AbortError" || signal.aborted) return;
      fill(answer, note("bad", h("h2", null, "No lobes"), error instanceof Problem ? error.message : "Something went wrong on this page."));
      if (!(error instanceof Problem)) console.error(error);
      else showProblem(form, error, { focus: document.activeElement === ask });
    }
  }

  function ontested(next) {
    tested = next;
    compute();
  }

  function changed(now = false) {
    tellSource();
    ask.hidden = !slow();
    if (slow()) return;
    clearTimeout(timer);
    timer = setTimeout(compute, now ? 0 : 450);
  }

  form.addEventListener("input", (event) => !event.target.closest(".picks") && changed());
  form.addEventListener("submit", busy(ask, compute));
  changed(true);
  if (slow()) compute();
  return () => {
    clearTimeout(timer);
    running?.abort();
  };
}

/** Lobes, advice and tooltip FRFs of a query: a preview at once, then the recommended cuts; slower methods come from a job that tells how far it is. */
async function* answers(body, signal, place, late) {
  const { lobes: question, tips, advice } = body;
  const quick = question.method === QUICK;
  const responses = Promise.all(tips.map((tip) => post("tooltip", tip, { signal })));
  if (!quick) {
    const told = (words, share) => {
      clearTimeout(late);
      fill(place, waiting(words), share === null ? null : h("progress", { max: 1, value: share, "aria-label": "progress" }));
    };
    // an answer that fails is told once, by the first of them
    const [found, shown] = await Promise.all([followLobes(question, signal, told), responses]);
    return void (yield { lobes: found.toolings, advice: null, tips: shown });
  }
  const [preview, shown] = await Promise.all([post("lobes", { ...question, recommend: false }, { signal }), responses]);
  yield { lobes: preview.toolings, advice: null, tips: shown };
  if (advice) yield { lobes: preview.toolings, advice: (await post("advice", advice, { signal })).toolings, tips: shown };
  else yield { lobes: (await post("lobes", question, { signal })).toolings, advice: null, tips: shown };
}

function toolingPicks(toolings, chosen, onchange) {
  const boxes = toolings.map((tooling) => {
    const box = h("input", {
      type: "checkbox",
      checked: chosen.has(tooling.name),
      onchange: () => {
        if (box.checked) chosen.add(tooling.name);
        else chosen.delete(tooling.name);
        limit();
        onchange();
      },
    });
    const words = h(
      "span",
      null,
      h("strong", null, tooling.name),
      " ",
      h(
        "span",
        { class: "soft small" },
        `${tooling.teeth} × Ø${text("length", tooling.diameter_mm, { digits: 0 })}, ${text("length", tooling.stickout_mm, { digits: 1 })} out`,
      ),
    );
    return { box, item: h("li", { dataset: { name: tooling.name.toLowerCase() } }, h("label", { class: "check" }, box, words)) };
  });
  function limit() {
    for (const { box } of boxes) box.disabled = !box.checked && chosen.size >= MOST;
  }
  limit();
  const list = h(
    "ul",
    { class: "picks" },
    boxes.map((b) => b.item),
  );
  if (toolings.length <= 8) return list;
  const search = h("input", {
    type: "search",
    placeholder: "Search …",
    "aria-label": "Search toolings",
    oninput: () => {
      const wanted = search.value.trim().toLowerCase();
      for (const { item, box } of boxes) item.hidden = !box.checked && !item.dataset.name.includes(wanted);
    },
  });
  return h("div", { class: "picks-box" }, search, list);
}
