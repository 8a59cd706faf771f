// A campaign: every cut with its verdict, uploads as they come in, and the way on to the identification.
import { get, getBlob, hasKey, send } from "../api.js";
import { add, card, choices, fill, h, head, link, note, save } from "../dom.js";
import { dropZone } from "../drop.js";
import { confirmed, failed } from "../forms.js";
import { filling, makeExample } from "../next_step.js";
import { go, keep, to } from "../router.js";
import { namedFiles, queueFor } from "../uploads.js";
import { text } from "../units.js";
import { recordingsOf } from "./forgotten.js";
import { identifyCard } from "./identify_card.js";
import { learnCard, taught } from "./learn_card.js";
import { recordingPanel } from "./recording.js";
import { hammerTable, stateOf, verdictTable } from "./verdicts.js";

const SHOWN = [
  ["all", "All"],
  ["not", "Not usable"],
  ["missing", "Missing"],
];

export async function view({ id }, query, place) {
  let campaign = await get(`campaigns/${id}`);
  const queue = queueFor(id);
  let filter = SHOWN.some(([name]) => name === query.get("show")) ? query.get("show") : "all";
  const fault = h("div");
  const counts = h("section", { class: "card", "aria-label": "State" });
  const strangers = h("div");
  const list = h("div");
  const hammer = h("div");
  const detail = h("div", { class: "view" });
  const next = h("div", { class: "view" });
  const { example } = campaign;
  add(
    place,
    head(
      campaign.name,
      [...counted(campaign), ...campaign.toolings].join(", "),
      link(`v1/campaigns/${id}/archive`, "Archive (ZIP)", "button quiet archive"),
      h("button", { type: "button", class: "quiet danger", onclick: remove }, "Delete"),
    ),
    fault,
    campaign.remarks.length ? note("doubt", ...campaign.remarks) : null,
    counts,
    next,
    strangers,
    example
      ? null
      : dropZone(
          campaign.hammer_tests.length ? "Drop recordings and FRFs here" : "Drop recordings here",
          "Files are known by their names; more than once does no harm.",
          (files) => queue.add(campaign, files),
          { small: true },
        ),
    hammer,
    h(
      "section",
      { class: "card", hidden: campaign.cuts.length === 0 },
      h(
        "header",
        null,
        h("h2", null, "Verdicts"),
        choices("Which cuts are shown", SHOWN, filter, (value) => {
          filter = value;
          keep({ show: value === "all" ? null : value });
          rows();
        }),
      ),
      list,
    ),
    detail,
  );

  const archive = place.querySelector(".archive");
  archive.addEventListener("click", async (event) => {
    // with a key the address alone opens nothing
    if (!hasKey()) return;
    event.preventDefault();
    save(`${campaign.name}.zip`, await getBlob(`campaigns/${id}/archive`));
  });

  const first = campaign.cuts.find((cut) => cut.id === query.get("cut") && cut.cut.uploaded);
  let open = first?.id ?? null;
  if (first) detailed(first, [first.cut, first.air].find((file) => file?.uploaded && file.name === query.get("recording"))?.name);
  function rows() {
    const shown = campaign.cuts
      .map((cut) => ({ cut, state: stateOf(cut, queue) }))
      .filter(
        ({ cut, state }) =>
          filter === "all" || (filter === "missing" ? !cut.cut.uploaded || (cut.air && !cut.air.uploaded) : state.kind === "bad"),
      );
    const kept = list.querySelector(".scrolls")?.scrollTop ?? 0;
    const focused = document.activeElement?.dataset?.cut;
    fill(
      list,
      shown.length
        ? verdictTable(shown, queue, open, toggle)
        : h("p", { class: "soft" }, filter === "all" ? "The campaign names no cuts." : "None."),
    );
    const scroller = list.querySelector(".scrolls");
    if (scroller) scroller.scrollTop = kept;
    if (focused) list.querySelector(`[data-cut="${CSS.escape(focused)}"]`)?.focus();
  }

  function detailed(cut, recording = null) {
    fill(detail, open ? recordingPanel(campaign, cut, recording, (name) => keep({ recording: name })) : null);
  }

  function toggle(cut) {
    open = open === cut.id ? null : cut.id;
    keep({ cut: open, recording: null });
    rows();
    detailed(cut);
    if (open) detail.scrollIntoView({ block: "nearest", behavior: "smooth" });
  }

  function state() {
    const items = [...queue.items.values()];
    const total = items.reduce((sum, item) => sum + item.file.size, 0);
    const sent = items.reduce((sum, item) => sum + (item.state === "done" ? item.file.size : Math.min(item.sent, item.file.size)), 0);
    const tested = campaign.hammer_tests.filter((test) => test.file.uploaded).length;
    const names = new Map(namedFiles(campaign).map((file) => [file.name, file.uploaded]));
    const uploaded = [...names.values()].filter(Boolean).length;
    const bad = campaign.cuts.filter((cut) => cut.verdict && !cut.verdict.usable).length;
    fill(
      counts,
      h(
        "dl",
        { class: "facts" },
        campaign.cuts.length
          ? [number("Usable cuts", `${campaign.usable} of ${campaign.cuts.length}`), number("Not usable", String(bad))]
          : null,
        campaign.hammer_tests.length ? number("Hammer tests", `${tested} of ${campaign.hammer_tests.length}`) : null,
        number("Files", `${uploaded} of ${names.size}`),
        campaign.cuts.length
          ? number(
              "Coefficient",
              campaign.workpiece?.tangential_coefficient_mpa ? text("pressure", campaign.workpiece.tangential_coefficient_mpa) : "–",
            )
          : null,
      ),
      queue.running
        ? [
            h("progress", { max: String(total), value: String(sent), "aria-label": "Upload" }),
            h(
              "p",
              { class: "soft small" },
              `${(sent / 1e6).toFixed(1)} of ${(total / 1e6).toFixed(1)} MB sent, three files at once. You may go elsewhere on this page meanwhile.`,
            ),
          ]
        : null,
    );
    fill(
      strangers,
      queue.strangers.length
        ? note(
            "doubt",
            `The campaign names none of these, so they were left aside: ${queue.strangers.slice(0, 8).join(", ")}${queue.strangers.length > 8 ? ` and ${queue.strangers.length - 8} more` : ""}.`,
          )
        : null,
    );
    onward();
  }

  let asked = null;
  function onward() {
    const made = example ? filling(campaign) : null;
    const tested = campaign.hammer_tests.filter((test) => test.file.uploaded).length;
    const ready = campaign.usable + tested > 0 && !queue.running && (made?.done ?? true);
    const names = ready ? taught(campaign) : [];
    const mode = `${ready} ${campaign.usable} ${tested} ${names}`;
    if (made && !made.done) add(counts, made.box);
    if (mode === asked) return;
    asked = mode;
    fill(next, names.length ? learnCard(campaign, names) : null, ready ? identifyCard(campaign) : null);
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
    if (stale || (example && !filling(campaign).done)) {
      stale = false;
      timer = setTimeout(fresh, 700);
    }
  }
  function draw() {
    rows();
    fill(hammer, campaign.hammer_tests.length ? card("Hammer tests", null, hammerTable(campaign.hammer_tests, queue)) : null);
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
  if (example && !filling(campaign).done) {
    // where the service was stopped meanwhile, it goes on
    makeExample().catch((error) => failed(fault, error));
    timer = setTimeout(fresh, 700);
  }
  return () => {
    clearTimeout(timer);
    queue.removeEventListener("change", onchange);
  };

  async function remove() {
    const names = [...new Set(namedFiles(campaign).filter((file) => file.uploaded).map((file) => file.name))];
    const words = h("div", { class: "view" }, h("p", null, "Deleted with it:"), recordingsOf(names), h("p", null, "What was identified from them stays."));
    if (!(await confirmed(`Delete ${campaign.name}?`, words, "Delete it"))) return;
    try {
      await send("DELETE", `campaigns/${id}`);
      go(`machines/${campaign.machine}/recordings`);
    } catch (error) {
      failed(fault, error);
    }
  }
}

/** What a campaign holds, in words. */
const counted = ({ cuts, hammer_tests }) => [
  ...(cuts.length ? [`${cuts.length} cuts`] : []),
  ...(hammer_tests.length ? [`${hammer_tests.length} hammer tests`] : []),
];

const number = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));
