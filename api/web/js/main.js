// The frame: header, sections, and which view belongs to which address.
import { Problem } from "./api.js";
import { choices, fill, h, icon, note } from "./dom.js";
import { shareOf } from "./jobs.js";
import { keep, mayLeave, route, show, to, where } from "./router.js";
import { runningFor, watchJobs } from "./running.js";
import { allMachines, choose, forgetAll, knownMachines, machine } from "./state.js";
import { isInch, setInch } from "./units.js";
import { askForKey, keyButton } from "./views/keys.js";

const view =
  (file, name = "view") =>
  async (...given) =>
    (await import(`./views/${file}.js`))[name](...given);

/** A view of the machine that this person works at: its address says which one, so whoever gets it sees the same. */
const ofMachine = (shown) => async (args, query, place) => {
  await allMachines();
  const asked = query.get("machine");
  if (knownMachines().some((m) => m.id === asked)) choose(asked);
  if (machine() && place.isConnected) keep({ machine: machine().id });
  return shown(args, query, place);
};

route("", "machines", view("machines"));
route("machines/:id", "machines", view("machine"));
route("machines/:id/recordings", "recordings", view("recordings"));
route("recordings", "recordings", ofMachine(view("recordings")));
route("campaigns/new", "recordings", ofMachine(view("campaign_form")));
route("campaigns/:id", "recordings", view("campaign"));
route("campaigns/:id/:name", "recordings", view("recording"));
route("identification", "identification", ofMachine(view("identifications")));
route("machines/:id/identification", "identification", view("identifications"));
route("identifications/:id", "identification", view("identification"));
route("toolings", "toolings", view("toolings"));
route("toolings/new", "toolings", view("tooling"));
route("toolings/edit/:name", "toolings", view("tooling"));
route("toolings/ring/:name", "toolings", view("ring"));
route("changes", "toolings", view("changes"));
route("robots", "robots", view("robots"));
route("paths", "paths", view("paths"));
route("change", "change", ofMachine(view("change")));
route("card", "change", view("tool_card"));
route("listen", "listen", view("listen"));
route("tap", "listen", view("tap"));
route("tip", "listen", view("tip"));
route("forces", "forces", ofMachine(view("forces")));
route("forces/live", "forces", ofMachine(view("live")));

const SECTIONS = [
  ["machines", "Machines", "Machines", ""],
  ["listen", "Listen", "Listen", "listen"],
  ["recordings", "Recordings", "Cuts", "recordings"],
  ["identification", "Identification", "Identify", "identification"],
  ["toolings", "Toolings", "Tools", "toolings"],
  ["change", "Tool change", "Lobes", "change"],
  ["robots", "Robots", "Robots", "robots"],
  ["paths", "Paths", "Paths", "paths"],
  ["forces", "Forces", "Forces", "forces"],
];

const main = document.getElementById("main");
let section = "machines";

function steps() {
  const here = machine();
  const known = here?.identification;
  const states = {
    machines: here ? `${knownMachines().length} known` : "begin here",
    identification: underWay(here) || (known ? known.status : ""),
  };
  const items = SECTIONS.map(([name, long, short, path]) =>
    h(
      "li",
      null,
      h(
        "a",
        { href: to(path), "aria-current": name === section ? "page" : null },
        icon(name === "machines" ? "machine" : name),
        h(
          "span",
          null,
          h("span", { class: "long" }, long),
          h("span", { class: "short" }, short),
          states[name] && h("span", { class: "state" }, states[name]),
        ),
      ),
    ),
  );
  fill(document.getElementById("steps"), h("ol", null, items));
}

/** How far the identification of a machine is, where one runs: so every tab shows it. */
function underWay(machine) {
  const job = machine && runningFor(machine.id);
  if (!job) return "";
  const share = shareOf(job);
  return job.state === "queued" ? "waiting" : share === null ? "running" : `running, ${Math.round(100 * share)} %`;
}

function picker() {
  const known = knownMachines();
  if (!known.length) return null;
  const here = machine();
  const list = h(
    "select",
    {
      id: "machine-here",
      onchange: () => {
        choose(list.value);
        // what is open belongs to the other machine
        if (/^(campaigns|identifications|machines)\//.test(where().path))
          location.hash = to(section === "machines" ? `machines/${list.value}` : section);
        else {
          // its campaigns are its own
          if (where().query.has("machine")) keep({ machine: list.value, campaign: null, recording: null, watch: null });
          refresh();
        }
      },
    },
    known.map((m) => h("option", { value: m.id, selected: m.id === here?.id }, m.name)),
  );
  return h("label", { for: "machine-here" }, h("span", { class: "words" }, "Machine"), list);
}

function top() {
  const dark = document.documentElement.dataset.theme ?? "auto";
  const focused = document.activeElement?.id;
  fill(
    document.getElementById("top"),
    h(
      "a",
      { class: "brand", href: to("") },
      h("img", { src: document.querySelector('link[rel="icon"]').href, alt: "" }),
      h("span", null, "rcsa-ident"),
    ),
    picker(),
    h("span", { class: "space" }),
    choices(
      "Units",
      [
        ["mm", "mm"],
        ["inch", "inch"],
      ],
      isInch() ? "inch" : "mm",
      (value) => setInch(value === "inch"),
    ),
    choices(
      "Light or dark",
      [
        ["light", "Light"],
        ["auto", "Auto"],
        ["dark", "Dark"],
      ],
      dark,
      setTheme,
    ),
    keyButton(),
    h("a", { href: "docs", class: "small" }, "API"),
  );
  if (focused) document.getElementById(focused)?.focus();
}

function setTheme(value) {
  if (value === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = value;
  try {
    localStorage.setItem("rcsa.theme", value);
  } catch {
    // for this visit
  }
  window.dispatchEvent(new Event("theme"));
}

function onshow(next, args) {
  section = next;
  if (section !== "" && args.id && where().path.startsWith("machines/")) choose(args.id);
  top();
  steps();
}

function onerror(place, error) {
  if (error.name === "AbortError") return;
  if (!(error instanceof Problem)) console.error(error);
  const words = error.status === 404 ? "It is not there, or belongs to another group." : error.message;
  fill(place, note("bad", h("h1", null, "This cannot be shown"), words, h("p", null, h("a", { href: to("") }, "To the machines"))));
}

async function refresh(moved = false) {
  if (!(await mayLeave())) return;
  await show(main, onshow, onerror);
  // who reads with the ears hears that something else is there now
  if (moved) main.focus({ preventScroll: true });
  if (moved) window.scrollTo(0, 0);
}

window.addEventListener("hashchange", () => refresh(true));
window.addEventListener("machines", () => {
  top();
  steps();
});
window.addEventListener("running", steps);
window.addEventListener("refresh", () => refresh());
window.addEventListener("key-changed", async () => {
  forgetAll();
  await start();
});
window.addEventListener("key-wanted", askForKey);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => window.dispatchEvent(new Event("theme")));
document.getElementById("skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
// a file let go beside the field for it does not replace the page
for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => event.preventDefault());

async function start() {
  try {
    await allMachines();
  } catch (error) {
    top();
    steps();
    onerror(main, error);
    return;
  }
  await refresh();
}

await start();
watchJobs();
