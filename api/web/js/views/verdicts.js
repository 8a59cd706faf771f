// The verdicts of a campaign's cuts: how each one stands, and why.
import { h, mark, table } from "../dom.js";
import { plain, q } from "../units.js";

/** How a cut stands: its uploads first, then the service's verdict. */
export function stateOf(cut, queue) {
  const items = [cut.cut, cut.air]
    .filter(Boolean)
    .map((file) => queue.items.get(file.name))
    .filter((item) => item && item.state !== "done");
  const broken = items.find((item) => item.state === "failed");
  if (broken)
    return {
      kind: "bad",
      words: broken.problem.status === 409 ? "another file is there" : "not taken",
      reasons: [broken.problem.message],
      broken,
    };
  if (items.some((item) => item.state === "sending")) {
    const share =
      items.reduce((sum, item) => sum + (item.state === "sending" ? item.sent : 0), 0) /
      items.reduce((sum, item) => sum + item.file.size, 0);
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

function said(state, queue) {
  return [
    state.reasons.map((each) => h("div", null, each)),
    (state.notes ?? []).map((each) => h("div", { class: "soft" }, each)),
    state.broken
      ? h(
          "div",
          { class: "row-of-buttons" },
          h(
            "button",
            {
              type: "button",
              class: "link",
              onclick: (event) => {
                event.stopPropagation();
                queue.retry(state.broken.name);
              },
            },
            "Try again",
          ),
          state.broken.problem.status === 409
            ? h(
                "button",
                {
                  type: "button",
                  class: "link",
                  onclick: (event) => {
                    event.stopPropagation();
                    queue.retry(state.broken.name, true);
                  },
                },
                "Put it in place of that one",
              )
            : null,
        )
      : null,
  ];
}

/** A cut's speed, or those of a pass. */
function speeds(cut) {
  const last = cut.spindle_speed_to_rpm ?? null;
  return last === null ? plain(cut.spindle_speed_rpm) : `${plain(cut.spindle_speed_rpm)} to ${plain(last)}`;
}

/** A row for each cut; `toggle(cut)` opens its recording. */
export function verdictTable(shown, queue, open, toggle) {
  return table(
    "Verdict of every cut",
    [
      {
        name: "Cut",
        cell: ({ cut }) =>
          cut.cut.uploaded
            ? h(
                "button",
                {
                  type: "button",
                  class: "link",
                  dataset: { cut: cut.id },
                  "aria-expanded": String(open === cut.id),
                  onclick: (event) => {
                    event.stopPropagation();
                    toggle(cut);
                  },
                },
                cut.id,
              )
            : cut.id,
      },
      { name: "Verdict", cell: ({ state }) => mark(state.kind, state.words) },
      { name: "Tooling", cell: ({ cut }) => cut.tooling },
      { name: "Speed", unit: "rev/min", number: true, cell: ({ cut }) => speeds(cut) },
      { name: "Measured", unit: "rev/min", number: true, cell: ({ cut }) => plain(cut.verdict?.spindle_speed_rpm ?? null, 1, 1) },
      { name: "Depth", number: true, cell: ({ cut }) => q("depth", cut.axial_depth_mm) },
      { name: "Lines", number: true, cell: ({ cut }) => (cut.verdict ? String(cut.verdict.lines) : "–") },
      { name: "S/N X", unit: "dB", number: true, cell: ({ cut }) => plain(cut.verdict?.signal_to_noise_db?.X ?? null) },
      { name: "S/N Y", unit: "dB", number: true, cell: ({ cut }) => plain(cut.verdict?.signal_to_noise_db?.Y ?? null) },
      { name: "Why, and what else", cell: ({ cut, state }) => h("div", { class: "why" }, said(state, queue)) },
    ],
    shown,
    {
      tall: true,
      row: ({ cut }) => ({
        class: cut.cut.uploaded ? "pick" : null,
        "aria-selected": open === cut.id ? "true" : null,
        onclick: () => cut.cut.uploaded && toggle(cut),
      }),
    },
  );
}

const place = (point) => (typeof point === "number" ? `${plain(point, 1)} mm from the tip` : point);

/** A row for each hammer test. */
export function hammerTable(tests, queue) {
  const rows = tests.map((test) => {
    const verdict = test.lines === null ? null : { usable: true, reasons: [], notes: [] };
    return { test, state: stateOf({ cut: test.file, air: null, verdict }, queue) };
  });
  return table(
    "Hammer tests",
    [
      { name: "Test", cell: ({ test }) => test.id },
      { name: "State", cell: ({ state }) => mark(state.kind, state.words) },
      { name: "Tooling", cell: ({ test }) => test.tooling },
      { name: "Axis", cell: ({ test }) => test.axis },
      { name: "Response", cell: ({ test }) => place(test.response) },
      { name: "Force", cell: ({ test }) => place(test.force) },
      { name: "Lines", number: true, cell: ({ test }) => (test.lines === null ? "–" : String(test.lines)) },
      { name: "Why", cell: ({ state }) => h("div", { class: "why" }, said(state, queue)) },
    ],
    rows,
  );
}
