// What comes next for a machine, said wherever there is nothing to show yet; without any machine, that is an example.
import { all, howFar, send } from "./api.js";
import { card, empty, fill, h, link, waiting } from "./dom.js";
import { busy, failed } from "./forms.js";
import { go, to } from "./router.js";
import { isRunning, lastJob } from "./running.js";
import { allMachines, choose } from "./state.js";

/** Make the example, or what is missing of it, and return its machine and campaign. */
export const makeExample = async () => (await send("POST", "examples/campaign")).json();

/** A button that has the virtual machine cut a campaign, and shows it. */
export function tryButton(fault, kind = "primary") {
  const button = h("button", { type: "button", class: kind || null }, "Try it with an example");
  button.addEventListener(
    "click",
    busy(button, async () => {
      const looks = setInterval(
        () =>
          howFar().then(
            (words) => button.disabled && fill(fault, waiting(words)),
            () => {}, // the request that is waited for says what is wrong
          ),
        1000,
      );
      try {
        fill(fault, waiting("The virtual machine gets ready …"));
        const made = await makeExample();
        choose(made.machine);
        await allMachines(true);
        go(`campaigns/${made.campaign}`);
      } catch (error) {
        failed(fault, error);
      } finally {
        clearInterval(looks);
      }
    }),
  );
  return button;
}

/** The example as the first thing that a newcomer sees. */
export function exampleCard(fault) {
  return card(
    "No recordings at hand?",
    null,
    h(
      "p",
      null,
      "A virtual machine makes 24 cuts. Identify it from them, change the tool, and read the best speed. All of it is marked as an example, and goes with one click.",
    ),
    h("div", { class: "row-of-buttons" }, tryButton(fault)),
  );
}

/** What to do first where there is no machine. */
export function noMachine(words) {
  const fault = h("div");
  const box = empty("No machine yet", words, tryButton(fault), link(to(""), "Begin with a machine of your own", "button"), link(to("listen"), "Listen to one recording", "button"));
  box.append(fault);
  return box;
}

/** What to do next for a machine that is not identified, from what there is of it. */
export async function nextStep(machine, words) {
  if (!machine) return noMachine(words);
  const title = `${machine.name} has not been identified`;
  const job = await lastJob(machine.id);
  if (job && isRunning(job))
    return empty(
      `${machine.name} is being identified`,
      "Watch it: the way on is there as soon as it is done.",
      link(to(`identifications/${job.id}`), "To the running identification", "button primary"),
    );
  const campaigns = await all(`machines/${machine.id}/campaigns`);
  const best = campaigns.reduce((found, each) => (each.usable >= (found?.usable ?? 1) ? each : found), null);
  if (best)
    return empty(
      title,
      `“${best.name}” has ${best.usable} usable cuts of ${best.cuts}. ${words}`,
      link(to(`campaigns/${best.id}`), "Identify it from them", "button primary"),
    );
  const hit = campaigns.findLast((each) => each.hammer_tests && !each.missing && !each.cuts);
  if (hit)
    return empty(
      title,
      `“${hit.name}” has ${hit.hammer_tests} hammer tests. ${words}`,
      link(to(`campaigns/${hit.id}`), "Identify it from them", "button primary"),
    );
  const last = campaigns.at(-1);
  if (last)
    return empty(
      title,
      `“${last.name}” names ${last.cuts} cuts, and none of them is usable yet. ${words}`,
      link(to(`campaigns/${last.id}`), "To the campaign", "button primary"),
    );
  return empty(
    title,
    `Drop in recordings of ordinary stable cuts, and identify it from them. ${words}`,
    link(to(`machines/${machine.id}/recordings`), "To the recordings", "button primary"),
  );
}

let begun = null;

/** Seconds that the rest of an example takes at the pace that this page has seen, or null. */
function rest(id, there, all) {
  const now = performance.now() / 1000;
  if (begun?.id !== id) begun = { id, there, now };
  return there > begun.there ? Math.ceil(((now - begun.now) / (there - begun.there)) * (all - there)) : null;
}

/** How far the virtual machine is with an example campaign; it goes on where it was stopped. */
export function filling(campaign) {
  const files = campaign.cuts.flatMap((cut) => [cut.cut, cut.air]).filter(Boolean);
  const there = files.filter((file) => file.uploaded).length;
  const box = h("div", { class: "view" });
  const judged = campaign.cuts.filter((cut) => cut.verdict).length;
  if (there === files.length && judged === campaign.cuts.length) return { box, done: true };
  const seconds = rest(campaign.id, there, files.length);
  fill(
    box,
    h("progress", { max: String(files.length), value: String(there), "aria-label": "Recordings of the example" }),
    h("p", { class: "soft small" }, `The virtual machine is cutting: ${there} of ${files.length} recordings are there. ${seconds === null ? "" : `The rest takes about ${seconds} s at this pace. `}Identify it as soon as they all are.`),
  );
  return { box, done: false };
}
