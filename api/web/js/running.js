// Identifications under way, known in every tab: asked for every few seconds while somebody looks.
import { get } from "./api.js";
import { RUNNING } from "./jobs.js";

const PAUSE = 4000;
let jobs = [];
let told = "";

export const isRunning = (job) => RUNNING.includes(job.state);

/** The running identification of a machine, or null. */
export const runningFor = (machine) => jobs.find((job) => job.machine === machine) ?? null;

/** The newest identification of a machine, or null. */
export async function lastJob(machine) {
  return (await get(`identifications?machine=${machine}&limit=1`)).items[0] ?? null;
}

async function look() {
  if (document.hidden) return;
  try {
    jobs = (await get("identifications?limit=20")).items.filter(isRunning);
  } catch {
    // the view itself says what is wrong
    return;
  }
  const now = jobs.map((job) => `${job.id} ${job.state} ${job.progress?.stage} ${job.progress?.done}`).join();
  if (now === told) return;
  told = now;
  window.dispatchEvent(new Event("running"));
}

/** Look now, and from then on every few seconds. */
export function watchJobs() {
  look();
  setInterval(look, PAUSE);
  document.addEventListener("visibilitychange", look);
  window.addEventListener("job-begun", look);
}
