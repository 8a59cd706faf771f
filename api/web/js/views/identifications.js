// Identifications of a machine, newest first.
import { all } from "../api.js";
import { add, card, empty, h, head, link, mark, table } from "../dom.js";
import { kindOf, wordsOf } from "../jobs.js";
import { to } from "../router.js";
import { allMachines, machine } from "../state.js";

export async function view({ id = null }, _query, place) {
  const machines = await allMachines();
  const here = id ? machines.find((m) => m.id === id) : machine();
  if (!here) {
    return void add(
      place,
      head("Identification", null),
      empty(
        "No machine yet",
        "An identification needs recordings of a machine's cuts.",
        link(to(""), "Begin with a machine", "button primary"),
      ),
    );
  }
  const [jobs, campaigns] = await Promise.all([all(`identifications?machine=${here.id}`), all(`machines/${here.id}/campaigns`)]);
  const names = new Map(campaigns.map((c) => [c.id, c.name]));
  const last = campaigns.at(-1);
  add(place, head("Identification", here.name, here.identification ? link(to(`machines/${here.id}`), "Modes now", "button") : null));
  if (!jobs.length) {
    const words = last
      ? `“${last.name}” has ${last.usable} usable cuts of ${last.cuts}.`
      : "Drop in recordings of ordinary stable cuts first.";
    return void add(
      place,
      empty(
        "Nothing was identified here yet",
        words,
        last
          ? link(to(`campaigns/${last.id}`), "To the campaign", "button primary")
          : link(to("recordings"), "To the recordings", "button primary"),
      ),
    );
  }
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
          { name: "", cell: (j) => h("span", { class: "soft" }, j.problem?.detail ?? "") },
        ],
        jobs,
      ),
    ),
  );
}
