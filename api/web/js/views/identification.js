// One identification: while it runs its cost over time and the fit so far, afterwards its modes and what could not be told.
import { follow, get, getBlob, getText, hasKey, Problem, send } from "../api.js";
import { add, card, fill, h, head, link, mark, note, save } from "../dom.js";
import { chart, legend, plotly, SERIES } from "../charts.js";
import { busy, failed } from "../forms.js";
import { kindOf, RUNNING, shareOf, wordsOf } from "../jobs.js";
import { to } from "../router.js";
import { allMachines } from "../state.js";
import { costFigure, fitFigure } from "./identification_figures.js";
import { coupling, drawings, learned, modesCards, notes } from "./modes.js";

export async function view({ id }, _query, place) {
  let job = await get(`identifications/${id}`);
  const leaving = new AbortController();
  const fault = h("div");
  const story = h("div");
  const state = h("section", { class: "card", "aria-live": "polite", "aria-label": "State" });
  const cancel = h("button", { type: "button", class: "danger" }, "Cancel");
  const reports = h("span", { class: "row-of-buttons" });
  const result = h("div", { class: "view" });
  const cost = chart("Misfit over time", "", "Every try of the search appears here as it comes.");
  const fit = chart("Measured points and model", "", "The lines of all cuts appear here with the first fit, and the model beside them.");
  // it takes a while to load, and is there when the first point comes
  plotly();
  const trace = new Map();
  const fits = new Map();
  const axesKey = () =>
    legend(
      ["X", "Y"].flatMap((axis, k) => [
        { name: `${axis} measured`, series: SERIES[k], kind: "dots" },
        { name: `${axis} model`, series: SERIES[k] },
      ]),
    );
  const costCard = card(
    "Misfit over time",
    null,
    legend(["X", "Y", "both"].map((axis, k) => ({ name: axis === "both" ? "both axes" : axis, series: SERIES[k] }))),
    cost,
  );
  const fitCard = card("Measured points and model", null, axesKey(), fit);
  const live = h("div", { class: "split live" }, costCard, fitCard);
  add(place, head("Identification", null, reports, cancel), fault, state, story, live);
  cancel.addEventListener(
    "click",
    busy(cancel, async () => {
      try {
        job = await (await send("DELETE", `identifications/${id}`)).json();
        draw();
      } catch (error) {
        failed(fault, error);
      }
    }),
  );

  let clock = null;
  function draw() {
    const going = RUNNING.includes(job.state);
    cancel.hidden = !going;
    const seconds = job.started
      ? Math.max(0, Math.round(((job.finished ? new Date(job.finished) : new Date()) - new Date(job.started)) / 1000))
      : null;
    const share = shareOf(job);
    fill(
      state,
      h(
        "div",
        { class: "row-of-buttons" },
        mark(kindOf(job), job.state === "done" ? job.status : job.state),
        h("span", null, going ? wordsOf(job) : ""),
        seconds === null ? null : h("span", { class: "soft number" }, `${seconds} s`),
        job.campaign ? link(to(`campaigns/${job.campaign}`), "its campaign") : null,
      ),
      going
        ? h("progress", share === null ? { "aria-label": "Progress" } : { max: "1", value: String(share), "aria-label": "Progress" })
        : null,
      job.problem
        ? note("bad", job.problem.detail, ...(job.problem.errors ?? []).slice(1).map((e) => `${e.field}: ${e.found}; allowed ${e.allowed}`))
        : null,
      job.state === "cancelled" ? note("", "It was cancelled; nothing of the machine has changed.") : null,
    );
    if (!going) clearInterval(clock);
  }

  let over = false;
  let due = new Set();
  let timer = null;
  function redraw(which) {
    due.add(which);
    // a burst of events is one picture
    timer ??= setTimeout(() => {
      timer = null;
      const now = due;
      due = new Set();
      if (now.has("cost")) cost.draw((plot) => costFigure(trace, plot.clientWidth));
      if (now.has("fit") && !over) fit.draw(() => fitFigure(fits));
    }, 250);
  }

  draw();
  if (RUNNING.includes(job.state)) clock = setInterval(draw, 1000);
  const events = follow(
    `identifications/${id}/events`,
    (event, data) => {
      if (event === "trace") {
        if (!trace.has(data.axis)) trace.set(data.axis, []);
        trace.get(data.axis).push(data);
        redraw("cost");
      } else if (event === "fit") {
        fits.set(data.axis, data);
        redraw("fit");
      } else if (event === "note") {
        add(story, note("", data.text));
      } else if (event === "progress" || event === "end") {
        job = data;
        draw();
      }
      return event === "end";
    },
    leaving.signal,
  );
  events
    .then(() => finished())
    .catch((error) => {
      if (!leaving.signal.aborted) failed(fault, error);
    });

  async function finished() {
    if (leaving.signal.aborted) return;
    try {
      job = await get(`identifications/${id}`);
      draw();
      if (!trace.size) costCard.hidden = true;
      if (job.state !== "done") return;
      // the answer comes first; how it was found is there for those who ask
      live.replaceWith(result, fitCard, trace.size ? h("details", null, h("summary", null, "How it was found"), costCard) : "");
      const [modes, frf] = await Promise.all([get(`identifications/${id}/modes`), get(`identifications/${id}/frf`)]);
      over = true;
      fit.draw(() => fitFigure(measured(frf)));
      if (job.status !== "failed") await allMachines(true);
      fill(result, outcome(modes), coupling(modes), h("div", { class: "modes" }, learned(modes), modesCards(modes), drawings(modes), notes(modes)));
      fill(
        reports,
        job.status === "failed" ? null : link(to("change", { machine: job.machine }), "Change the tool", "button primary"),
        files(id, fault),
      );
    } catch (error) {
      failed(fault, error);
      if (!(error instanceof Problem)) console.error(error);
    }
  }
  return () => {
    leaving.abort();
    clearInterval(clock);
    clearTimeout(timer);
  };
}

function outcome(modes) {
  if (modes.status === "failed") return note("bad", h("strong", null, "Nothing was identified"), ...modes.reasons);
  return [modes.reasons.length ? note("doubt", h("strong", null, `The result is ${modes.status}`), ...modes.reasons) : null];
}

/** The final FRFs in the form of the events. */
function measured(frf) {
  const size = (re, im) => re.map((value, k) => Math.hypot(value, im[k]));
  return new Map(
    Object.entries(frf.axes).map(([axis, f]) => [
      axis,
      {
        axis,
        frequency_hz: f.frequency_hz,
        measured_abs: size(f.measured_re, f.measured_im),
        model_abs: size(f.model_re, f.model_im),
        tooling: f.tooling,
      },
    ]),
  );
}

function files(id, fault) {
  const report = link(`v1/identifications/${id}/report`, "Report", "button");
  report.target = "_blank";
  report.rel = "noopener";
  report.addEventListener("click", async (event) => {
    // an address carries no key: with one, the report comes as a file
    if (!hasKey()) return;
    event.preventDefault();
    try {
      save("report.html", await getBlob(`identifications/${id}/report`));
    } catch (error) {
      failed(fault, error);
    }
  });
  return [
    report,
    h(
      "button",
      {
        type: "button",
        onclick: async () => {
          try {
            save("RESULT.json", await getText(`identifications/${id}/result`, "application/json"), "application/json");
          } catch (error) {
            failed(fault, error);
          }
        },
      },
      "RESULT.json",
    ),
  ];
}
