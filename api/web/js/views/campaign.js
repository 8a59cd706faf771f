// A campaign: every cut with its verdict, uploads as they come in, and the way on to the identification.
import { get, post, Problem, send } from "../api.js";
import { add, card, choices, fill, h, head, link, mark, note, table } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, confirmed, failed, field, quantity, select } from "../forms.js";
import { go, to } from "../router.js";
import { queueFor } from "../uploads.js";
import { plain, q, text } from "../units.js";
import { recordingPanel } from "./recording.js";

const SHOWN = [["all", "All"], ["not", "Not usable"], ["missing", "Missing"]];

export async function view({ id }, query, place) {
  let campaign = await get(`campaigns/${id}`);
  const queue = queueFor(id);
  let filter = query.get("show") ?? "all";
  const fault = h("div");
  const counts = h("section", { class: "card", "aria-label": "State" });
  const strangers = h("div");
  const list = h("div");
  const detail = h("div", { class: "view" });
  const next = h("div");
  add(place, head(campaign.name, `${campaign.cuts.length} cuts, ${campaign.toolings.join(", ")}`,
    link(`v1/campaigns/${id}/archive`, "Archive (ZIP)", "button quiet archive"),
    h("button", { type: "button", class: "quiet danger", onclick: remove }, "Delete")), fault, counts, next, strangers,
  dropZone("Drop recordings here", "Files are known by their names; more than once does no harm.", (files) => queue.add(campaign, files), { small: true }),
  h("section", { class: "card" }, h("header", null, h("h2", null, "Verdicts"), choices("Which cuts are shown", SHOWN, filter, (value) => {
    filter = value;
    rows();
  })), list), detail);

  const archive = place.querySelector(".archive");
  archive.addEventListener("click", async (event) => {
    // with a key the address alone opens nothing
    const { hasKey, getBlob } = await import("../api.js");
    if (!hasKey()) return;
    event.preventDefault();
    const { save } = await import("../dom.js");
    save(`${campaign.name}.zip`, await getBlob(`campaigns/${id}/archive`));
  });

  function stateOf(cut) {
    const items = [cut.cut, cut.air].filter(Boolean).map((file) => queue.items.get(file.name)).filter((item) => item && item.state !== "done");
    const broken = items.find((item) => item.state === "failed");
    if (broken) return { kind: "bad", words: broken.problem.status === 409 ? "another file is there" : "not taken", reasons: [broken.problem.message], broken };
    if (items.some((item) => item.state === "sending")) {
      const share = items.reduce((sum, item) => sum + (item.state === "sending" ? item.sent : 0), 0) / items.reduce((sum, item) => sum + item.file.size, 0);
      return { kind: "busy", words: `${Math.min(99, Math.round(share * 100))} %`, reasons: [] };
    }
    if (items.length) return { kind: "idle", words: "waiting", reasons: [] };
    if (!cut.cut.uploaded) return { kind: "idle", words: "no file yet", reasons: [], missing: true };
    const verdict = cut.verdict;
    if (!verdict) return { kind: "busy", words: "being read", reasons: [] };
    if (!verdict.usable) return { kind: "bad", words: "not usable", reasons: verdict.reasons, notes: verdict.notes };
    const doubts = [...verdict.notes, ...(cut.air && !cut.air.uploaded ? ["its air cut is missing"] : [])];
    return { kind: doubts.length ? "doubt" : "good", words: "usable", reasons: [], notes: doubts };
  }

  function said(state, cut) {
    return [
      state.reasons.map((each) => h("div", null, each)), (state.notes ?? []).map((each) => h("div", { class: "soft" }, each)),
      state.broken ? h("div", { class: "row-of-buttons" },
        h("button", { type: "button", class: "link", onclick: (event) => { event.stopPropagation(); queue.retry(state.broken.name); } }, "Try again"),
        state.broken.problem.status === 409 ? h("button", { type: "button", class: "link", onclick: (event) => { event.stopPropagation(); queue.retry(state.broken.name, true); } }, "Put it in place of that one") : null) : null,
    ];
  }

  let open = null;
  function rows() {
    const shown = campaign.cuts.map((cut) => ({ cut, state: stateOf(cut) })).filter(({ cut, state }) =>
      filter === "all" || (filter === "missing" ? !cut.cut.uploaded || (cut.air && !cut.air.uploaded) : state.kind === "bad"));
    const kept = list.querySelector(".scrolls")?.scrollTop ?? 0;
    const focused = document.activeElement?.dataset?.cut;
    fill(list, shown.length ? table("Verdict of every cut", [
      { name: "Cut", cell: ({ cut }) => (cut.cut.uploaded ? h("button", { type: "button", class: "link", dataset: { cut: cut.id }, "aria-expanded": String(open === cut.id), onclick: (event) => { event.stopPropagation(); toggle(cut); } }, cut.id) : cut.id) },
      { name: "Verdict", cell: ({ state }) => mark(state.kind, state.words) },
      { name: "Tooling", cell: ({ cut }) => cut.tooling },
      { name: "Speed", unit: "rev/min", number: true, cell: ({ cut }) => plain(cut.spindle_speed_rpm) },
      { name: "Measured", unit: "rev/min", number: true, cell: ({ cut }) => plain(cut.verdict?.spindle_speed_rpm ?? null, 1, 1) },
      { name: "Depth", number: true, cell: ({ cut }) => q("depth", cut.axial_depth_mm) },
      { name: "Lines", number: true, cell: ({ cut }) => (cut.verdict ? String(cut.verdict.lines) : "–") },
      { name: "S/N X", unit: "dB", number: true, cell: ({ cut }) => plain(cut.verdict?.signal_to_noise_db?.X ?? null) },
      { name: "S/N Y", unit: "dB", number: true, cell: ({ cut }) => plain(cut.verdict?.signal_to_noise_db?.Y ?? null) },
      { name: "Why, and what else", cell: ({ cut, state }) => h("div", { class: "why" }, said(state, cut)) },
    ], shown, { tall: true, row: ({ cut }) => ({ class: cut.cut.uploaded ? "pick" : null, "aria-selected": open === cut.id ? "true" : null, onclick: () => cut.cut.uploaded && toggle(cut) }) }) : h("p", { class: "soft" }, filter === "all" ? "The campaign names no cuts." : "None."));
    const scroller = list.querySelector(".scrolls");
    if (scroller) scroller.scrollTop = kept;
    if (focused) list.querySelector(`[data-cut="${CSS.escape(focused)}"]`)?.focus();
  }

  function toggle(cut) {
    open = open === cut.id ? null : cut.id;
    rows();
    fill(detail, open ? recordingPanel(campaign, cut) : null);
    if (open) detail.scrollIntoView({ block: "nearest", behavior: "smooth" });
  }

  function state() {
    const items = [...queue.items.values()];
    const total = items.reduce((sum, item) => sum + item.file.size, 0);
    const sent = items.reduce((sum, item) => sum + (item.state === "done" ? item.file.size : Math.min(item.sent, item.file.size)), 0);
    const files = campaign.cuts.flatMap((cut) => [cut.cut, cut.air]).filter(Boolean);
    const names = new Map(files.map((file) => [file.name, file.uploaded]));
    const uploaded = [...names.values()].filter(Boolean).length;
    const bad = campaign.cuts.filter((cut) => cut.verdict && !cut.verdict.usable).length;
    fill(counts, h("dl", { class: "facts" },
      number("Usable cuts", `${campaign.usable} of ${campaign.cuts.length}`), number("Not usable", String(bad)), number("Files", `${uploaded} of ${names.size}`),
      number("Coefficient", campaign.workpiece?.tangential_coefficient_mpa ? text("pressure", campaign.workpiece.tangential_coefficient_mpa) : "–")),
    queue.running ? [h("progress", { max: String(total), value: String(sent), "aria-label": "Upload" }), h("p", { class: "soft small" }, `${(sent / 1e6).toFixed(1)} of ${(total / 1e6).toFixed(1)} MB sent, three files at once. You may go elsewhere on this page meanwhile.`)] : null);
    fill(strangers, queue.strangers.length ? note("doubt", `The campaign names none of these, so they were left aside: ${queue.strangers.slice(0, 8).join(", ")}${queue.strangers.length > 8 ? ` and ${queue.strangers.length - 8} more` : ""}.`) : null);
    onward();
  }

  let asked = null;
  function onward() {
    const ready = campaign.usable > 0 && !queue.running;
    const mode = `${ready} ${campaign.usable}`;
    if (mode === asked) return;
    asked = mode;
    fill(next, ready ? identifyCard(campaign, fault) : null);
  }

  let timer = null;
  let stale = false;
  async function fresh() {
    timer = null;
    try {
      campaign = await get(`campaigns/${id}`);
    } catch (error) {
      failed(fault, error);
    }
    draw();
    if (stale) {
      stale = false;
      timer = setTimeout(fresh, 700);
    }
  }
  function draw() {
    rows();
    state();
  }
  let drawing = false;
  const onchange = (event) => {
    const item = event.detail;
    if (item?.state === "done" || item?.state === "failed") {
      if (timer) stale = true;
      else timer = setTimeout(fresh, 300);
    }
    if (drawing) return;
    drawing = true;
    setTimeout(() => {
      drawing = false;
      draw();
    }, 200);
  };
  queue.addEventListener("change", onchange);
  draw();
  return () => {
    clearTimeout(timer);
    queue.removeEventListener("change", onchange);
  };

  async function remove() {
    if (!await confirmed(`Delete ${campaign.name}?`, "Its recordings go with it. What was identified from them stays.", "Delete it")) return;
    try {
      await send("DELETE", `campaigns/${id}`);
      go(`machines/${campaign.machine}/recordings`);
    } catch (error) {
      failed(fault, error);
    }
  }
}

const number = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));

/** The next step, and what may be set for it. */
function identifyCard(campaign, fault) {
  const seed = quantity("Seed", "none", 1, { name: "seed", hint: "The same seed gives the same result." });
  const method = select([["default", "Default"], ["paper", "As in the paper"]], "default");
  const apply = h("input", { type: "checkbox", checked: true, id: "apply" });
  const start = h("input", { type: "checkbox", id: "start" });
  const button = h("button", { class: "primary" }, "Identify the machine");
  const form = h("form", { novalidate: true, class: "view" },
    h("div", { class: "row-of-buttons" }, button, h("span", { class: "soft" }, `from ${campaign.usable} usable cuts; it takes about a minute for 80`)),
    h("details", null, h("summary", null, "Settings"), h("div", { class: "fields" }, seed, field("Method", method, { name: "method" }),
      h("label", { class: "check", for: "apply" }, apply, "the machine takes the result"), h("label", { class: "check", for: "start" }, start, "go on from the machine's last result"))));
  form.addEventListener("submit", busy(button, async () => {
    try {
      const job = await post("identifications", { campaign: campaign.id, seed: seed.input.base, method: method.value, start: start.checked, apply: apply.checked });
      go(`identifications/${job.id}`);
    } catch (error) {
      failed(form, error);
      if (!(error instanceof Problem)) throw error;
    }
  }));
  return card(null, null, form);
}
