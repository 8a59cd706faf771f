// The answers to a tool change as they come: a preview at once, then the recommended cuts, or another method's limits speed by speed.
import { post } from "../api.js";
import { fill, h } from "../dom.js";
import { followLobes, secondsIn, shareOf, wordsOf } from "../jobs.js";
import { QUICK } from "./change_question.js";

/**
 * The answers of a question, each better than the one before: {lobes, advice, tips}, and `coming` where a job computes the lobes.
 * `advice` has the recommended cuts, whichever method the lobes are of.
 * `heard.told(job)` and `heard.part(partial)` follow that job.
 */
export async function* answers({ lobes: question, tips, advice }, signal, heard) {
  const preview = { ...question, method: QUICK, recommend: false };
  const [{ lobes }, shown] = await Promise.all([
    post("lobes", preview, { signal }).then((found) => ({ lobes: found.toolings })),
    Promise.all(tips.map((tip) => post("tooltip", tip, { signal }))),
  ]);
  const coming = question.method === QUICK ? null : question.method;
  yield { lobes, advice: null, tips: shown, coming };
  const told = (await (advice ? post("advice", advice, { signal }) : post("lobes", { ...question, method: QUICK }, { signal }))).toolings;
  const tried = advice || coming ? lobes : told;
  yield { lobes: tried, advice: told, tips: shown, coming };
  if (!coming) return;
  const found = await followLobes({ ...question, recommend: false }, signal, heard);
  if (found) yield { lobes: found.toolings, advice: told, tips: shown, coming: null };
}

/** What is going on, above the answers: that they are those of the question before, or how far a job is, for how long, and a way to end it. */
export function standing(onstop) {
  const words = h("span");
  const time = h("span", { class: "number" });
  const line = h("p", null, h("span", null, words, time));
  const bar = h("progress", { max: 1, value: 0, "aria-label": "How far it is" });
  const stop = h("button", { type: "button", onclick: onstop }, "Stop");
  const element = h("div", { class: "standing", hidden: true }, line, bar, stop);
  let timer = null;
  const show = (said, { goes = false, share = null, job = false, refused = false } = {}) => {
    clearInterval(timer);
    fill(words, said);
    fill(time);
    line.classList.toggle("waiting", goes);
    bar.hidden = share === null;
    bar.value = share ?? 0;
    stop.hidden = !job;
    element.hidden = said === "";
    for (const name of ["note", "bad"]) element.classList.toggle(name, refused);
  };
  return {
    element,
    clear: () => show(""),
    say: (said) => show(said),
    refused: (why) => show(`No lobes: ${why}`, { refused: true }),
    computing: (old) => show(old ? "computing … What stands below answers the question before." : "computing …", { goes: true }),
    /** A job's state; between two of its words the seconds go on. */
    job: (job, method) => {
      const since = performance.now();
      const tick = () => fill(time, clock(secondsIn(job) + (performance.now() - since) / 1000));
      show(`${method}: ${wordsOf(job)}, for `, { goes: true, share: shareOf(job), job: true });
      tick();
      timer = setInterval(tick, 1000);
    },
  };
}

/** Seconds as a clock shows them. */
function clock(seconds) {
  const [s, m] = [Math.floor(seconds % 60), Math.floor(seconds / 60)];
  return m < 60 ? `${m}:${String(s).padStart(2, "0")}` : `${Math.floor(m / 60)}:${String(m % 60).padStart(2, "0")}:${String(s).padStart(2, "0")}`;
}
