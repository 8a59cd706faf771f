// The library of toolings, drawn to scale.
import { all, part, Problem, send } from "../api.js";
import { add, card, empty, fill, h, head, link, note } from "../dom.js";
import { libraryDrawing } from "../drawing.js";
import { dropZone } from "../drop.js";
import { field, quantity, select } from "../forms.js";
import { to } from "../router.js";
import { machine } from "../state.js";
import { q } from "../units.js";
import { differingInWords } from "./changes.js";

let told = [];

export async function view(_args, _query, place) {
  const toolings = await all("toolings");
  const said = h("div", { class: "view", role: "status" }, spoken(told));
  told = [];
  const assumed = assumptions(toolings);
  add(
    place,
    head("Toolings", "Tool and holder, from the free end to the flange.", link(to("toolings/new"), "Draw a new one", "button primary"), link(to("changes"), "Changes", "button quiet")),
    said,
    toolings.length
      ? h("div", { class: "shelf" }, toolings.map(cardOf))
      : empty(
          "No tooling yet",
          "Draw one from its sheet, drop tooling files in, or import a tool library of Fusion 360 or HSM.",
          link(to("toolings/new"), "Draw one", "button primary"),
        ),
    dropZone(
      "Drop tooling files or a tool library",
      "Tooling files (.toml), or a library of Fusion 360 or HSM (.json, .tools): holders become segments.",
      (files) => take(files, said, assumed.read),
      { small: true },
    ),
    assumed.box,
  );
}

function cardOf(tooling) {
  const edit = to(`toolings/edit/${part(tooling.name)}`);
  return h(
    "section",
    { class: "card tooling" },
    h("a", { href: edit, class: "picture", tabindex: "-1", "aria-hidden": "true" }, libraryDrawing(tooling.name, { brief: true })),
    h("h2", null, link(edit, tooling.name)),
    h(
      "p",
      { class: "soft small" },
      `${tooling.teeth} teeth, Ø `,
      q("length", tooling.diameter_mm, { digits: 1 }),
      ", ",
      q("length", tooling.stickout_mm, { digits: 1 }),
      " out",
    ),
    h(
      "div",
      { class: "row-of-buttons" },
      machine()?.identification ? link(to("change", { tooling: tooling.name }), "Lobes", "button") : null,
      link(edit, "Edit", "button quiet"),
      link(to("toolings/new", { from: tooling.name }), "Copy", "button quiet"),
    ),
  );
}

const stem = (file) =>
  file.name
    .replace(/\.[^.]+$/, "")
    .replace(/[^A-Za-z0-9 ._+()-]/g, "-")
    .slice(0, 64)
    .replace(/^[^A-Za-z0-9]+/, "");

/** Write tooling files into the library, and import tool libraries; each is told for itself. */
async function take(files, said, assumed) {
  const lines = [];
  for (const file of files) {
    try {
      if (/\.toml$/i.test(file.name)) {
        await send("PUT", `toolings/${part(stem(file))}`, {
          body: await file.text(),
          headers: { "Content-Type": "application/toml", "If-None-Match": "*" },
        });
        lines.push(["good", `${file.name}: in the library as ${stem(file)}`]);
      } else if (/\.(json|hsmlib|tools)$/i.test(file.name)) lines.push(...(await imported(file, assumed)));
      else lines.push(["doubt", `${file.name}: neither a tooling file (.toml) nor a tool library (.json)`]);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      lines.push(["bad", `${file.name}: ${error.status === 412 ? await already(file) : error.message}`]);
    }
  }
  if (lines.some(([kind]) => kind === "good")) {
    // the library is drawn anew, and what was said stands above it
    told = lines;
    window.dispatchEvent(new Event("refresh"));
  } else fill(said, spoken(lines));
}

/** Why a file is not taken: its name is in the library. */
async function already(file) {
  const options = { body: await file.text(), headers: { "Content-Type": "application/toml" } };
  const { differences } = await (await send("POST", `toolings/${part(stem(file))}/differences`, options)).json();
  if (!differences.length) return `${stem(file)} is in the library already, and the same`;
  return `${stem(file)} is in the library already, and differs (${differingInWords(differences)}); it stays as it is`;
}

function spoken(lines) {
  return ["bad", "doubt", "good"].map((kind) => {
    const some = lines.filter(([each]) => each === kind).map(([, words]) => words);
    return some.length
      ? note(
          kind,
          h(
            "ul",
            null,
            some.map((words) => h("li", null, words)),
          ),
        )
      : null;
  });
}

async function imported(file, assumed) {
  const packed = /\.tools$/i.test(file.name);
  const query = new URLSearchParams(Object.entries(assumed()).filter(([, value]) => value !== null && value !== "")).toString();
  const answer = await send("POST", `toolings/import${query ? `?${query}` : ""}`, {
    body: file,
    headers: { "Content-Type": packed ? "application/zip" : "application/json" },
  });
  const { items } = await answer.json();
  return items.map((item) => [
    item.status === "written" ? "good" : "doubt",
    `${item.name}: ${item.status === "written" ? "in the library" : item.status}${item.reason ? `, ${item.reason}` : ""}${item.assumed.length ? `; assumed: ${item.assumed.join(", ")}` : ""}`,
  ]);
}

/** What an import takes where the library of tools says nothing; `read()` gives it as the query's keys. */
function assumptions(toolings) {
  const flute = quantity("Fluted part bends as, of the diameter", "percent", 80, {
    hint: "The core of a cutter is thinner than its edges",
  });
  const helix = quantity("Helix", "degree", 30);
  const contact = select([["", "assumed, as in the catalogue"], ...toolings.map((t) => [t.name, `as in ${t.name}`])], "");
  const box = h(
    "details",
    null,
    h("summary", null, "What an import assumes where a tool library says nothing"),
    h("div", { class: "fields broad" }, flute, helix, field("Contact of tool and holder", contact)),
  );
  return {
    box,
    read: () => ({
      flute_ratio: flute.input.base === null ? null : flute.input.base / 100,
      helix_deg: helix.input.base,
      contact: contact.value,
    }),
  };
}
