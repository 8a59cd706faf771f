// What a campaign's cuts teach of toolings that are new to its machine: looked at first, then taken over.
import { post, send } from "../api.js";
import { card, fill, h, mark, note, table, tell, waiting } from "../dom.js";
import { busy, failed } from "../forms.js";
import { allMachines, knownMachines } from "../state.js";
import { plain } from "../units.js";
import { beforeAndAfter, OWN } from "./spreads.js";

/** The toolings that a campaign may teach: all that cut or were hit are new to an identified machine, and none of their drawings is exact. */
export function taught(campaign) {
  const known = knownMachines().find((m) => m.id === campaign.machine)?.identification;
  if (!known?.axes.length || known.status === "measured") return [];
  if (known.taught_by.some((name) => name.endsWith(`(${campaign.id})`))) return [];
  const hit = campaign.hammer_tests.filter((test) => test.lines);
  if (hit.some((test) => test.response !== "tip" || test.force !== "tip")) return [];
  const used = [...new Set([...campaign.cuts.filter((cut) => cut.verdict?.usable), ...hit].map((each) => each.tooling))];
  return used.every((name) => campaign.rough_toolings.includes(name) && !known.toolings.includes(name)) ? used : [];
}

export function learnCard(campaign, names) {
  const look = h("button", { type: "button", class: "primary" }, "See what they teach");
  const answer = h("div", { class: "view" });
  look.addEventListener(
    "click",
    busy(look, async () => {
      fill(answer, waiting("Learning …"));
      try {
        fill(answer, shown(campaign, await post(`campaigns/${campaign.id}/learn`)));
      } catch (error) {
        failed(answer, error);
      }
    }),
  );
  return card(
    `${campaign.hammer_tests.length ? "These measurements teach" : "These cuts teach"} ${names.join(", ")}`,
    null,
    h("div", { class: "row-of-buttons" }, look, h("span", { class: "soft" }, "the machine is taken as it was identified; nothing is written yet")),
    answer,
  );
}

const KINDS = { converged: "good", suspect: "doubt", "not-converged": "bad" };

function shown(campaign, found) {
  const written = h("div");
  const machine = h("input", { type: "checkbox", id: "teach-machine" });
  const button = h("button", { type: "button", class: found.status === "converged" ? "primary" : null }, "Take over");
  const some = found.toolings.some((each) => each.tooling);
  button.addEventListener(
    "click",
    busy(button, async () => {
      try {
        const path = `campaigns/${campaign.id}/learn/take-over?machine=${machine.checked}`;
        const done = await (await send("POST", path, { headers: { "If-Match": `"${found.etag}"` } })).json();
        const told = [...done.written, ...(done.machine_written ? ["the machine"] : [])].join(", ");
        tell(told ? `Written: ${told}.` : "The library has it already.");
        fill(written, note("good", told ? `Written: ${told}. What they were stays as versions.` : "Nothing to write: the library has it already."));
        if (done.machine_written) await allMachines(true);
      } catch (error) {
        failed(written, error);
      }
    }),
  );
  return [
    h("p", null, mark(KINDS[found.status], found.status), ` ${left(found)}`),
    ...found.toolings.map((each) => toolingTable(each, found.toolings.length > 1)),
    notes(found),
    some
      ? h(
          "div",
          { class: "row-of-buttons" },
          button,
          found.status === "converged" ? h("label", { class: "check", for: "teach-machine" }, machine, "the machine learns, too: it and these toolings then belong together") : null,
        )
      : null,
    some ? h("p", { class: "small soft" }, OWN) : null,
    written,
  ];
}

const left = (found) => `${found.model_error.map((share) => `${plain(100 * share, 1, 1)} %`).join(" and ")} of the lines stay unexplained.`;

const toolingTable = (each, several) =>
  h(
    "div",
    { class: "view" },
    several ? h("h3", null, each.name) : null,
    each.contradiction ? note("bad", `${each.name} is not taken over: ${each.contradiction}`) : null,
    table(`${each.name} before and after`, beforeAndAfter("Drawn", (r) => [r.drawn, r.drawn_std], "Found", (r) => [r.found, r.found_std]), each.learned),
  );

function notes(found) {
  const told = [...found.warnings, ...found.notes, ...found.left_out.map((each) => `${each.cut} was left out: ${each.reason}`)];
  return told.length ? note("doubt", h("ul", null, told.map((each) => h("li", null, each)))) : null;
}
