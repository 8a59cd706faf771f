// Where lobes are computed: a form on the left, what it means for the cut on the right; the answer follows the form.
import { Problem } from "../api.js";
import { h } from "../dom.js";
import { busy, clearFaults, showProblem } from "../forms.js";
import { answers, standing } from "./change_answers.js";
import { results } from "./change_results.js";
import { notComputed } from "./headline.js";

/** Pause after which what was typed is asked [ms]. */
const TYPING = 250;
const BEFORE = "What stands below answers the question before.";

/**
 * The bench: `element`, `begin()`, `changed(now)` for what the form hears, `end()`. `toolings()` are the summaries of what may be asked about,
 * `keep(state)` writes an address, `query` is that of the address, `wanted` says what has to be told first where a form begins empty.
 */
export function lobesBench({ form, toolings, query, keep, wanted = "" }) {
  const found = h("div", { class: "change-results", "aria-live": "off" });
  const told = standing(stop);
  const element = h("div", { class: "change" }, form.element, h("div", { class: "change-answer" }, told.element, found));

  // how the answer is looked at
  const look = { parts: query.get("frf") === "cartesian" ? "cartesian" : "polar", shown: query.get("axes") ?? "both", at: number(query.get("at")) };
  look.keep = () => {
    const parts = look.parts === "polar" ? null : look.parts;
    keep({ ...form.state(), frf: parts, axes: look.shown === "both" ? null : look.shown, at: look.at });
  };
  let running = null;
  let timer = null;
  /** Whether what is shown answers what is asked. */
  const mark = (current) => found.classList.toggle("before", !current && found.childElementCount > 0);
  /** Nothing computes any more: no recommended cut is said to come. */
  const ended = () => {
    running?.abort();
    for (const best of found.querySelectorAll(".best[aria-busy]")) notComputed(best);
  };

  /** Compute; whoever is still telling what is wanted is not told what is missing. */
  function begin() {
    if (!wanted || found.childElementCount || !form.problem()) return compute();
    look.keep();
    told.say(wanted);
  }

  async function compute() {
    clearTimeout(timer);
    look.keep();
    form.tell();
    running?.abort();
    const mine = (running = new AbortController());
    const { signal } = mine;
    clearFaults(form.element);
    told.clear();
    mark(false);
    const problem = form.problem();
    if (problem) {
      ended();
      if (found.childElementCount) told.say(BEFORE);
      return void showProblem(form.element, problem, { focus: false });
    }
    const late = setTimeout(() => told.computing(found.childElementCount > 0), found.childElementCount ? 400 : 0);
    let drawn = null;
    const heard = {
      told: (job) => signal.aborted || told.job(job, form.body().lobes.method),
      part: (partial) => signal.aborted || drawn.part(partial),
    };
    const body = form.body();
    try {
      for await (const answer of answers(body, signal, heard)) {
        clearTimeout(late);
        if (signal.aborted) return;
        told.clear();
        mark(true);
        drawn = results(found, answer, { toolings: toolings(), body, tested: form.tested, ontested, look });
      }
    } catch (error) {
      clearTimeout(late);
      if (error.name === "AbortError" || signal.aborted) return;
      ended();
      mark(false);
      told.refused(error instanceof Problem ? error.message : "Something went wrong on this page.");
      if (!(error instanceof Problem)) console.error(error);
      else showProblem(form.element, error, { focus: document.activeElement === form.button });
    }
  }

  function stop() {
    ended();
    told.say("Stopped. “Compute” asks again.");
  }

  function ontested(next) {
    form.tested = next;
    compute();
  }

  function changed(now = false) {
    clearTimeout(timer);
    if (form.slow()) {
      look.keep();
      // what is shown answers something else, and its job works for nobody
      ended();
      told.clear();
      mark(false);
      return void (found.childElementCount && told.say(`${BEFORE} “Compute” asks this one.`));
    }
    // digits of one number follow each other faster
    timer = setTimeout(begin, now ? 0 : TYPING);
  }

  form.element.addEventListener("submit", busy(form.button, compute));
  const end = () => {
    clearTimeout(timer);
    running?.abort();
    told.clear();
  };
  return { element, begin, changed, end };
}

const number = (written) => (written === null || written === "" || !Number.isFinite(Number(written)) ? null : Number(written));
