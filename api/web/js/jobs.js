// Work that takes its time: accepted as a job, followed until it is done.
import { follow, get, Problem, send } from "./api.js";

export const RUNNING = ["queued", "running"];
const ORDINALS = ["first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth"];

/** A job's state in words: who waits is told the place, who is at work how far it is. */
export function wordsOf(job) {
  if (job.state === "queued") {
    if (!job.queue || job.queue.waiting < 2) return "waiting for a free worker";
    return `${ORDINALS[job.queue.place - 1] ?? `number ${job.queue.place}`} of ${job.queue.waiting} waiting for a free worker`;
  }
  if (job.state === "running") {
    if (!job.progress) return "starting";
    const { stage, done, total } = job.progress;
    if (stage === "speeds") return `${done} of ${total} speeds`;
    if (stage === "removal") return `material taken out on ${done} of ${total} moves`;
    if (stage === "stability") return `${done} of ${total} different cuts judged`;
    if (stage === "milling") return `${Math.round((100 * done) / (total || 1))} % of the path milled`;
    return `${stage}${total ? `, ${done} of ${total}` : ""}`;
  }
  if (job.state === "failed") return "failed";
  if (job.state === "cancelled") return "cancelled";
  return job.status ?? "done";
}

export const kindOf = (job) =>
  job.state === "done"
    ? ({ converged: "good", "not validated": "doubt", suspect: "doubt", failed: "bad" }[job.status] ?? "good")
    : ({ failed: "bad", cancelled: "idle" }[job.state] ?? "busy");

export const shareOf = (job) => (job.progress?.total ? job.progress.done / job.progress.total : null);

/** How long a job has been in its state [s]. */
export const secondsIn = (job) => (job.state === "queued" ? job.waited_s : job.running_s);

/**
 * Lobes by a slower method, from a job. `told(job)` hears of its state, `part(partial)` of the limits that are known so far.
 * Whoever aborts the signal, leaves the view or closes the tab cancels it; a browser that is gone without a word stops to follow it.
 */
export async function followLobes(question, signal, { told, part }) {
  // never broken off: a job that the service has just accepted would go on for nobody
  const job = await (await send("POST", "lobes", { json: question, headers: { Prefer: "respond-async, while-watched" } })).json();
  const path = `lobes/${job.id}`;
  const cancel = () => send("DELETE", path, { keepalive: true }).catch(() => {});
  if (signal.aborted) return void cancel();
  signal.addEventListener("abort", cancel);
  window.addEventListener("pagehide", cancel);
  try {
    told(job);
    const on = (event, data) => {
      if (event === "partial") part(data);
      else if (event === "progress" || event === "end") told(data);
      return event === "end";
    };
    await follow(`${path}/events`, on, signal);
    if (signal.aborted) return;
    const { answer, job: ended } = await get(path, { signal });
    if (answer) return answer;
    throw new Problem(0, ended.problem ?? { detail: `The job is ${ended.state}.` });
  } finally {
    signal.removeEventListener("abort", cancel);
    window.removeEventListener("pagehide", cancel);
  }
}
