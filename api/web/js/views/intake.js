// What was dropped: a campaign and its toolings and recordings are recognised by what is in them, and taken in after one look.
import { all, once, part, post, Problem, send } from "../api.js";
import { card, fill, h, note, waiting } from "../dom.js";
import { busy, field, select, showProblem } from "../forms.js";
import { go, to } from "../router.js";
import { allMachines, choose, knownMachines, machine } from "../state.js";
import { queueFor } from "../uploads.js";
import { unzipped } from "../zip.js";
import { keepFiles } from "./campaign_form.js";
import { differing } from "./changes.js";

const RECORDING = /\.(h5|hdf5|tdms|uff|unv|wav|rf64|bwf|w64|aiff?|caf|flac|ogg|opus|mp3|mat|parquet|csv)$/i;
const TOML = { "Content-Type": "application/toml" };
const last = (path) => path.split(/[\\/]/).at(-1);

/** Sort files into campaign, toolings, recordings and others, by their content where the name does not say enough. */
export async function sorted(files) {
  const found = { campaign: null, toolings: [], recordings: [], others: [] };
  for (const file of files) {
    if (/\.toml$/i.test(file.name) && file.size < 4e6) {
      const text = await file.text();
      if (/^\s*\[(campaign|\[cuts\])\]/m.test(text)) found.campaign = { file, text };
      else if (/^\s*\[cutter\]/m.test(text)) found.toolings.push({ file, text });
      else found.others.push(file);
    } else if (RECORDING.test(file.name)) found.recordings.push(file);
    else if (!file.name.startsWith(".")) found.others.push(file);
  }
  return found;
}

const TOOLINGS = /^\s*\[toolings\][^\n]*\n([\s\S]*?)(?=^\s*\[|$(?![\s\S]))/m;

/** The key and the file that a line of [toolings] names, by a look that leaves the reading to the service. */
function namedIn(line) {
  const [, bare, one, two, path] = /^\s*(?:([A-Za-z0-9_-]+)|"([^"]+)"|'([^']+)')\s*=\s*["']([^"']+\.toml)["']/.exec(line) ?? [];
  return path ? [last(path), bare ?? one ?? two] : null;
}

/** Which key of [toolings] names which file. */
export const keysOfToolings = (text) => new Map((TOOLINGS.exec(text)?.[1] ?? "").split("\n").map(namedIn).filter(Boolean));

/** The campaign with the texts of toolings in the place of their files: it takes them from itself, not from the library. */
export function withToolings(text, texts) {
  // JSON's escapes are TOML's, but for DEL
  const quoted = (words) => JSON.stringify(words).replaceAll("\x7f", "\\u007f");
  const inlined = (line) => {
    const key = namedIn(line)?.[1];
    return texts.has(key) ? `${quoted(key)} = ${quoted(`${texts.get(key)}\n`)}` : line;
  };
  return text.replace(TOOLINGS, (block) => block.split("\n").map(inlined).join("\n"));
}

const nameIn = (text) => /^\s*\[campaign\][^[]*?^\s*name\s*=\s*["']([^"']*)["']/ms.exec(text)?.[1] ?? "";
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
    found = await sorted((await Promise.all(files.map((file) => (/\.zip$/i.test(file.name) ? unzipped(file) : [file])))).flat());
  } catch (error) {
    fill(place, note("bad", error.message));
    return;
  }
  if (!found.campaign) {
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
  const keys = keysOfToolings(found.campaign.text);
  const library = new Set((await all("toolings")).map((t) => t.name));
  const toolings = await Promise.all(
    found.toolings.map(async ({ file, text }) => {
      const key = keys.get(file.name) ?? file.name.replace(/\.toml$/i, "");
      return { key, text, listed: keys.has(file.name), there: library.has(key) ? await compared(key, text) : null };
    }),
  ).catch((error) => {
    fill(place, note("bad", error.message, ...(error.errors ?? []).map((e) => `${e.field}: found ${e.found}, allowed ${e.allowed}`)));
    if (!(error instanceof Problem)) throw error;
  });
  if (!toolings) return;
  offer(place, found, toolings, [...keys.values()]);
}

/** Where a dropped tooling differs from the library's. */
async function compared(key, text) {
  const answer = await send("POST", `toolings/${part(key)}/differences`, { body: text, headers: TOML }).catch((error) => {
    throw named(error, `tooling ${key}`);
  });
  return answer.json();
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

function offer(place, found, toolings, wanted) {
  const title = nameIn(found.campaign.text);
  const here = machine();
  const which = select([...knownMachines().map((m) => [m.id, m.name]), ["", "A new machine"]], here?.id ?? "");
  const called = h("input", { autocomplete: "off", maxlength: 64 });
  called.value = asName(title);
  const naming = field("Its name", called, { name: "name" });
  naming.hidden = which.value !== "";
  which.addEventListener("change", () => (naming.hidden = which.value !== ""));
  const apart = toolings.filter((t) => t.there?.differences.length).map(choiceOf);
  const missing = wanted.filter((key) => !toolings.some((t) => t.key === key));
  const button = h("button", { class: "primary" }, "Take it in");
  const said = h("div", { role: "status" });
  const form = h(
    "form",
    { novalidate: true, class: "view" },
    h(
      "dl",
      { class: "facts" },
      fact("Campaign", title || found.campaign.file.name),
      fact("Toolings", toolings.map((t) => t.key).join(", ") || "of the library"),
      fact("Recordings", String(found.recordings.length)),
      found.others.length ? fact("Left aside", `${found.others.length} other files`) : null,
    ),
    h(
      "div",
      { class: "fields" },
      field("Machine", which),
      naming,
    ),
    apart.map((t) =>
      h(
        "section",
        { class: "view", "data-tooling": t.key },
        note("doubt", `${t.key} is in the library already, and differs:`),
        differing(t.there.differences, "In the library", "Dropped"),
        field(`What to do with ${t.key}`, t.choice),
      ),
    ),
    missing.length ? note("", `Not among the files, so taken from the library: ${missing.join(", ")}.`) : null,
    h("div", { class: "row-of-buttons" }, button, h("button", { type: "button", onclick: () => fill(place) }, "Leave it")),
    said,
  );
  form.addEventListener(
    "submit",
    busy(button, async () => {
      const key = once();
      try {
        fill(said, waiting("writing toolings and campaign …"));
        const machineId = which.value || (await made(called.value.trim()));
        const chosen = (what) => apart.filter((t) => t.choice.value === what);
        const why = new URLSearchParams({ why: `with the campaign ${title || found.campaign.file.name}`.slice(0, 200) });
        for (const tooling of [...toolings.filter((t) => t.there === null), ...chosen("replace")]) {
          // over what was shown, and over nothing else
          const seen = tooling.there ? { "If-Match": `"${tooling.there.etag}"` } : { "If-None-Match": "*" };
          await send("PUT", `toolings/${part(tooling.key)}?${why}`, { body: tooling.text, headers: { ...TOML, ...seen } }).catch((error) => {
            throw named(error, `tooling ${tooling.key}`);
          });
        }
        const own = new Map(chosen("campaign").map((t) => [t.key, t.text]));
        const answer = await send("POST", `machines/${machineId}/campaigns`, {
          body: withToolings(found.campaign.text, own),
          headers: { ...TOML, ...key },
        }).catch((error) => {
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

async function made(name) {
  return (await post("machines", { name, description: "" }, { headers: once() })).id;
}
