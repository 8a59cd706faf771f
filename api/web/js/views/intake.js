// What was dropped: a campaign and its toolings and recordings are recognised by what is in them, and taken in after one look.
import { once, part, post, Problem, send } from "../api.js";
import { card, fill, h, note, waiting } from "../dom.js";
import { busy, field, select, showProblem } from "../forms.js";
import { go, to } from "../router.js";
import { allMachines, choose } from "../state.js";
import { queueFor } from "../uploads.js";
import { unzipped } from "../zip.js";
import { keepFiles } from "./campaign_form.js";
import { differing } from "./changes.js";
import { targetMachine } from "./target_machine.js";

const RECORDING = /\.(h5|hdf5|tdms|uff|unv|wav|rf64|bwf|w64|aiff?|caf|flac|ogg|opus|mp3|mat|parquet|csv)$/i;
const TOML = { "Content-Type": "application/toml" };

/** Sort files into TOML with its text, recordings and others, by their names. */
async function sorted(files) {
  const found = { texts: new Map(), recordings: [], others: [] };
  for (const file of files) {
    if (/\.toml$/i.test(file.name) && file.size < 1e6) found.texts.set(file.name, await file.text());
    else if (RECORDING.test(file.name)) found.recordings.push(file);
    else if (!file.name.startsWith(".")) found.others.push(file);
  }
  return found;
}

/** What the TOML files mean is what the service reads in them. */
async function read({ texts, recordings, others }) {
  const told = await post("campaigns/preview", { files: [...texts].map(([name, text]) => ({ name, text })) });
  const toolings = told.toolings.map((t) => ({ ...t, text: texts.get(t.file) }));
  // what hammer tests name is known by that name alone
  const wanted = new Set(told.recordings);
  const named = (file) => wanted.has(file.name.normalize("NFC"));
  return {
    told,
    toolings,
    text: texts.get(told.campaign),
    recordings: [...recordings, ...others.filter(named)],
    others: [...others.filter((file) => !named(file)), ...told.others],
  };
}

/** The campaign with the texts of toolings in the place of their files: it takes them from itself, not from the library. */
function withToolings({ keys, toolings, from_library }, own) {
  const names = [...toolings.filter((t) => t.listed).map((t) => t.key), ...from_library];
  const given = Object.entries(keys.toolings ?? Object.fromEntries(names.map((name) => [name, name])));
  const inlined = ([key, what]) => {
    const called = typeof what === "string" && !what.endsWith(".toml") ? what : key;
    return [key, own.has(called) ? `${own.get(called)}\n` : what];
  };
  return { ...keys, toolings: Object.fromEntries(given.map(inlined)) };
}

const asName = (text) =>
  text
    .replace(/[^A-Za-z0-9 ._+()-]/g, " ")
    .replace(/^[^A-Za-z0-9]+/, "")
    .trim()
    .slice(0, 64) || "Machine 1";

/** Show what was dropped, and take it in where the person says so. */
export async function intake(place, files) {
  fill(place, waiting("looking at the files …"));
  let found = null;
  try {
    found = await read(await sorted((await Promise.all(files.map((file) => (/\.zip$/i.test(file.name) ? unzipped(file) : [file])))).flat()));
  } catch (error) {
    fill(place, note("bad", error.message, ...(error.errors ?? []).map((e) => `${e.field}: found ${e.found}, allowed ${e.allowed}`)));
    return;
  }
  if (!found.told.campaign) {
    if (found.recordings.length) {
      keepFiles(found.recordings);
      fill(
        place,
        card(
          "Recordings without a campaign",
          null,
          note(
            "doubt",
            `There is no campaign.toml among the ${files.length} files: nobody has said yet at which speed and with which tooling each one was cut.`,
          ),
          h("p", null, h("a", { class: "button primary", href: to("campaigns/new") }, "Describe the cuts here")),
        ),
      );
      return;
    }
    const only = found.toolings.length
      ? ["These are toolings. Drop them on the toolings' page."]
      : [
          "Nothing among these files is a campaign.toml, a tooling or a recording.",
          "Recordings are HDF5, TDMS, UFF 58, WAV and other sound, MATLAB, Parquet or CSV files.",
        ];
    fill(place, note("doubt", ...only));
    return;
  }
  offer(place, found);
}

/** What to do with a dropped tooling that differs from the library's: never over it, unless somebody says so. */
function choiceOf(tooling) {
  const choice = select(
    [
      ...(tooling.listed ? [["campaign", "use the dropped one for this campaign; the library keeps its own"]] : []),
      ["library", "use the library's"],
      ["replace", "replace the library's, for all machines; it stays as a version"],
    ],
    tooling.listed ? "campaign" : "library",
  );
  return { ...tooling, choice };
}

function offer(place, found) {
  const { told, toolings } = found;
  const title = told.name;
  const target = targetMachine(asName(title));
  const apart = toolings.filter((t) => t.differences.length).map(choiceOf);
  const absent = told.recordings.filter((name) => !found.recordings.some((file) => file.name.normalize("NFC") === name));
  const button = h("button", { class: "primary", disabled: told.missing.length > 0 }, "Take it in");
  const said = h("div", { role: "status" });
  const form = h(
    "form",
    { novalidate: true, class: "view" },
    h(
      "dl",
      { class: "facts" },
      fact("Campaign", title || told.campaign),
      fact("Toolings", toolings.map((t) => t.key).join(", ") || "of the library"),
      fact(told.keys?.frfs ? "Recordings and FRFs" : "Recordings", `${found.recordings.length}${absent.length ? `; the campaign names ${absent.length} more` : ""}`),
      found.others.length ? fact("Left aside", `${found.others.length} other files`) : null,
    ),
    h("div", { class: "fields broad" }, target.fields),
    target.remark,
    apart.map((t) =>
      h(
        "section",
        { class: "view", "data-tooling": t.key },
        note("doubt", `${t.key} is in the library already, and differs:`),
        differing(t.differences, "In the library", "Dropped"),
        t.differing > t.differences.length ? note("", `${t.differing - t.differences.length} further fields differ.`) : null,
        field(`What to do with ${t.key}`, t.choice),
      ),
    ),
    told.from_library.length ? note("", `Not among the files, so taken from the library: ${told.from_library.join(", ")}.`) : null,
    told.missing.length ? note("bad", `Neither among the files nor in the library: ${told.missing.join(", ")}. Drop their files, too.`) : null,
    h("div", { class: "row-of-buttons" }, button, h("button", { type: "button", onclick: () => fill(place) }, "Leave it")),
    said,
  );
  form.addEventListener(
    "submit",
    busy(button, async () => {
      const key = once();
      try {
        fill(said, waiting("writing toolings and campaign …"));
        const machineId = await target.id();
        const chosen = (what) => apart.filter((t) => t.choice.value === what);
        const why = new URLSearchParams({ why: `with the campaign ${title || told.campaign}`.slice(0, 200) });
        for (const tooling of [...toolings.filter((t) => t.etag === null), ...chosen("replace")]) {
          // over what was shown, and over nothing else
          const seen = tooling.etag ? { "If-Match": `"${tooling.etag}"` } : { "If-None-Match": "*" };
          await send("PUT", `toolings/${part(tooling.key)}?${why}`, { body: tooling.text, headers: { ...TOML, ...seen } }).catch((error) => {
            throw named(error, `tooling ${tooling.key}`);
          });
        }
        const own = new Map(chosen("campaign").map((t) => [t.key, t.text]));
        const body = own.size ? { json: withToolings(told, own), headers: key } : { body: found.text, headers: { ...TOML, ...key } };
        const answer = await send("POST", `machines/${machineId}/campaigns`, body).catch((error) => {
          throw named(error, "campaign.toml");
        });
        const campaign = await answer.json();
        choose(machineId);
        await allMachines(true);
        queueFor(campaign.id).add(campaign, found.recordings);
        go(`campaigns/${campaign.id}`);
      } catch (error) {
        fill(said);
        if (!(error instanceof Problem)) throw error;
        showProblem(form, error);
      }
    }),
  );
  fill(place, card("This is what was found", null, form));
  button.focus();
  place.scrollIntoView({ block: "nearest" });
}

const fact = (name, value) => h("div", null, h("dt", null, name), h("dd", null, value));

/** The problem of a file, said with the file's name: its keys are no fields of this form. */
function named(error, what) {
  if (!(error instanceof Problem)) return error;
  const errors = error.errors.map((e) => ({ ...e, field: `${what}: ${e.field}` }));
  return new Problem(error.status, { detail: `${what}: ${error.message}`, errors });
}
