// Identifications of a machine, newest first.
import { all } from "../api.js";
import { add, card, h, head, link, mark, table } from "../dom.js";
import { kindOf, wordsOf } from "../jobs.js";
import { noMachine, nextStep } from "../next_step.js";
import { to } from "../router.js";
import { allMachines, machine } from "../state.js";

const again = () => window.dispatchEvent(new Event("refresh"));

export async function view({ id = null }, _query, place) {
  const machines = await allMachines();
  const here = id ? machines.find((m) => m.id === id) : machine();
  if (!here) {
    return void add(
      place,
      head("Identification", null),
      noMachine("An identification needs recordings of a machine's cuts."),
    );
  }
  const [jobs, campaigns] = await Promise.all([all(`identifications?machine=${here.id}`), all(`machines/${here.id}/campaigns`)]);
  const names = new Map(campaigns.map((c) => [c.id, c.name]));
  add(place, head("Identification", here.name, here.identification ? link(to(`machines/${here.id}`), "Modes now", "button") : null));
  if (!jobs.length) return void add(place, await nextStep(here, "Its modes and its joint come with it."));
  add(
    place,
    card(
      "Identifications",
      null,
      table(
        "Identifications",
        [
          { name: "Begun", cell: (j) => link(to(`identifications/${j.id}`), new Date(j.created).toLocaleString()) },
          { name: "State", cell: (j) => mark(kindOf(j), wordsOf(j)) },
          {
            name: "Campaign",
            cell: (j) => (j.campaign ? link(to(`campaigns/${j.campaign}`), names.get(j.campaign) ?? "a campaign that was deleted") : "–"),
          },
          {
            name: "Took",
            number: true,
            cell: (j) => (j.started && j.finished ? `${Math.round((new Date(j.finished) - new Date(j.started)) / 1000)} s` : "–"),
          },
          { name: "Remark", cell: (j) => h("span", { class: "soft" }, j.problem?.detail ?? "") },
        ],
        jobs,
      ),
    ),
  );
  // another tab, or another person, has begun one, or it has come further
  window.addEventListener("running", again);
  return () => window.removeEventListener("running", again);
}
