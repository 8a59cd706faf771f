// Who changed which tooling or machine, when and why: the trail of all changes, the versions of one thing, and the way back.
import { get, part, post, Problem, send } from "../api.js";
import { add, fill, h, head, note, table, tell } from "../dom.js";
import { busy, confirmed, failed } from "../forms.js";
import { keep } from "../router.js";
import { allMachines } from "../state.js";

const SOME = 50;
const whoOf = (change) => (change.key === "local" ? "Somebody without a key" : change.who || "Somebody");
const thingOf = (change) =>
  change.kind === "identification" ? `the identification of ${change.title}` : `the ${change.kind} ${change.title}`;

/** A change as a sentence. */
export const inWords = (change) =>
  `${whoOf(change)} ${change.action} ${thingOf(change)}${change.restores ? ` from its version ${change.restores}` : ""}` +
  `${change.why ? `: “${change.why}”` : "."}`;

export async function view(_args, query, place) {
  add(place, head("Changes", "Who wrote which tooling, machine or identification, when and why. Nothing that was replaced is lost."));
  const onmore = (count) => keep({ entries: count });
  add(place, h("section", { class: "card", "aria-label": "All changes" }, await trail({}, Number(query.get("entries")) || SOME, onmore)));
}

/** The trail, newest first: all of it, or that of one thing; `onmore` hears how many entries are shown. */
export async function trail(wanted = {}, count = SOME, onmore = () => {}) {
  const box = h("div", { class: "view" });
  const fault = h("div");
  const list = h("div");
  const changes = [];
  let after = "";
  async function more() {
    const page = await get(`changes?${new URLSearchParams({ ...wanted, limit: SOME, after })}`);
    changes.push(...page.items);
    after = page.next;
    fill(list, changes.length ? table("Changes", COLUMNS(fault), changes) : h("p", { class: "soft" }, "Nothing has been changed yet."));
    earlier.hidden = !after;
  }
  const earlier = h("button", { type: "button", class: "quiet" }, "Show earlier ones");
  earlier.addEventListener(
    "click",
    busy(earlier, async () => {
      await more();
      if (list.isConnected) onmore(changes.length);
    }),
  );
  do await more();
  while (after && changes.length < count);
  return add(box, fault, list, earlier);
}

const COLUMNS = (fault) => [
  { name: "When", cell: (change) => new Date(change.created).toLocaleString() },
  { name: "What happened", cell: inWords },
  { name: "Version", number: true, cell: (change) => String(change.version) },
  { name: "Back", cell: (change) => wayBack(change, fault) },
];

function wayBack(change, fault) {
  if (!change.etag || change.kind === "machine") return null;
  return change.holds ? h("span", { class: "soft nowrap" }, "There now") : restoreButton(change, fault);
}

function restoreButton(change, fault) {
  const label = `Restore version ${change.version} of ${change.title}`;
  const button = h("button", { type: "button", class: "quiet small", "aria-label": label }, "Restore");
  const tooling = change.kind !== "identification";
  const thing = tooling ? `${change.kind}s/${part(change.name)}` : `machines/${part(change.name)}/identification`;
  const path = `${thing}/versions/${change.version}`;
  button.addEventListener(
    "click",
    busy(button, async () => {
      try {
        // over what the person has seen, and over nothing else
        const headers = await asSeen(thing);
        const words = tooling ? differing((await get(path)).differences, "Now", "Then") : [];
        const promise = h("p", null, "What is there now stays as a version, too.");
        if (!(await confirmed(`${label}?`, h("div", { class: "view" }, words, promise), "Restore it", "Leave it"))) return;
        await post(`${path}/restore`, undefined, { headers });
        if (!tooling) await allMachines(true);
        tell(`Version ${change.version} of ${change.title} is there again.`);
        window.dispatchEvent(new Event("refresh"));
      } catch (error) {
        const meanwhile = `Somebody has changed ${change.title} meanwhile, so nothing was restored. Look at its versions again.`;
        failed(fault, error.status === 412 ? new Problem(412, { detail: meanwhile }) : error);
      }
    }),
  );
  return button;
}

/** The condition that a thing is still what it is now, or still gone. */
async function asSeen(path) {
  try {
    return { "If-Match": (await send("HEAD", path)).headers.get("ETag") };
  } catch (error) {
    if (error.status !== 404) throw error;
    return { "If-None-Match": "*" };
  }
}

const shown = (value) => (value === null ? "–" : Array.isArray(value) ? value.join(", ") : String(value));
const UNITS = { mm: "mm", mm2: "mm²", mm4: "mm⁴", deg: "°", gpa: "GPa" };
/** A key in words, with its unit; segments are numbered as on the sheet of a tooling, from 1. */
const fieldWords = (name) =>
  name
    .replace(/segments\.(\d+)/, (_all, k) => `segment ${Number(k) + 1}`)
    .replace(/_(mm|mm2|mm4|deg|gpa)$/, (_all, unit) => ` [${UNITS[unit]}]`)
    .replaceAll(/[._]/g, " ");

/** Differences as a table: field, old, new. */
export function differing(differences, old, now) {
  if (!differences.length) return note("", "It is the same as what is in the library now.");
  return table(
    "Differences",
    [
      { name: "Field", cell: (d) => fieldWords(d.field) },
      { name: old, number: true, cell: (d) => shown(d.old) },
      { name: now, number: true, cell: (d) => shown(d.new) },
    ],
    differences,
  );
}

/** Differences in a line. */
export const differingInWords = (differences) =>
  differences.map((d) => `${fieldWords(d.field)} ${shown(d.old)} in the library, ${shown(d.new)} in the file`).join("; ");
