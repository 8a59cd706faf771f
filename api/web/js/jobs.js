// Work that takes its time: accepted as a job, followed until it is done.
import { follow, get, send } from "./api.js";

export const RUNNING = ["queued", "running"];

/** A job's state in words. */
export function wordsOf(job) {
  if (job.state === "queued") return "waiting for a free worker";
  if (job.state === "running")
    return job.progress
      ? `${job.progress.stage}${job.progress.total ? `, ${job.progress.done} of ${job.progress.total}` : ""}`
      : "starting";
  if (job.state === "failed") return "failed";
  if (job.state === "cancelled") return "cancelled";
  return job.status ?? "done";
}

export const kindOf = (job) =>
  job.state === "done"
    ? ({ converged: "good", suspect: "doubt", failed: "bad" }[job.status] ?? "good")
    : ({ failed: "bad", cancelled: "idle" }[job.state] ?? "busy");

export const shareOf = (job) => (job.progress?.total ? job.progress.done / job.progress.total : null);

/** Lobes by a slower method: at once where the service answers so, else from a job; leaving cancels it. */
export async function followLobes(question, signal, tell) {
  const answer = await send("POST", "lobes", { json: question, signal, headers: { Prefer: "respond-async" } });
  const first = await answer.json();
  if (answer.status !== 202) return first;
  tell("waiting for a free worker", null);
  signal.addEventListener("abort", () => send("DELETE", `lobes/${first.id}`).catch(() => {}));
  let last = first;
  await follow(
    `lobes/${first.id}/events`,
    (event, data) => {
      if (event === "progress" || event === "end") last = data;
      tell(wordsOf(last), shareOf(last));
      return event === "end";
    },
    signal,
  );
  const done = await get(`lobes/${first.id}`, { signal });
  if (done.answer) return done.answer;
  throw new Error(done.job.problem?.detail ?? `the job is ${done.job.state}`);
}
