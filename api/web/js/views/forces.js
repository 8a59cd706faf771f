// Forces from the same sensor: of a recording, and live.
import { all, get, part, Problem, problemOf, send } from "../api.js";
import { add, card, fill, h, head, save, waiting } from "../dom.js";
import { busy, clearFaults, field, quantity, select, showProblem } from "../forms.js";
import { nextStep } from "../next_step.js";
import { keep, to } from "../router.js";
import { allMachines, machine } from "../state.js";
import { forceResults } from "./force_results.js";

/** What a machine can do forces with, or what to do first. */
export async function ground(place, title) {
  await allMachines();
  const here = machine();
  if (here?.identification?.axes.length) return here;
  add(
    place,
    head(title, null),
    await nextStep(here, "Forces come through the machine's dynamics."),
  );
  return null;
}

export function tabs(here) {
  return h(
    "nav",
    { class: "switch links", "aria-label": "Forces" },
    [
      ["forces", "Of a recording"],
      ["forces/live", "Live"],
    ].map(([path, words]) => h("a", { href: to(path), class: "button", "aria-current": path === here ? "page" : null }, words)),
  );
}

/** Campaigns with something uploaded, and a pair of lists to pick one of their recordings. */
export async function recordingPicker(here, query, { air = false } = {}) {
  const campaigns = (await all(`machines/${here.id}/campaigns`)).filter((c) => c.uploaded > 0).reverse();
  const asked = campaigns.find((c) => c.id === query.get("campaign")) ?? campaigns[0];
  const which = select(
    campaigns.map((c) => [c.id, c.name]),
    asked?.id,
    {},
  );
  const recording = h("select", null);
  async function names() {
    const chosen = which.value;
    if (!chosen) return;
    const { cuts } = await get(`campaigns/${part(chosen)}`);
    // another one was chosen meanwhile
    if (which.value !== chosen) return;
    const files = cuts
      .flatMap((cut) => [cut.cut.uploaded ? cut.cut.name : null, air && cut.air?.uploaded ? cut.air.name : null])
      .filter(Boolean);
    const wanted = query.get("recording");
    fill(
      recording,
      [...new Set(files)].map((name) => h("option", { value: name, selected: name === wanted }, name)),
    );
  }
  which.addEventListener("change", names);
  await names();
  return {
    any: campaigns.length > 0,
    which,
    recording,
    fields: [field("Campaign", which, { name: "campaign", double: true }), field("Recording", recording, { name: "recording" })],
  };
}

export async function view(_args, query, place) {
  const here = await ground(place, "Forces");
  if (!here) return;
  const [picker, toolings] = await Promise.all([recordingPicker(here, query), all("toolings")]);
  const method = () =>
    select(
      [
        ["resonators", "Oscillators at the orders"],
        ["paper", "Random walk, as in the paper"],
      ],
      query.get("method") ?? "resonators",
    );
  const answer = h("div", { class: "view" });
  const forms = [];
  add(place, head("Forces", `What the cutter feels, from the flange of ${here.name}`, tabs("forces")));
  const columns = h("div", { class: "columns" });
  add(place, columns, answer);

  if (picker.any) {
    const how = method();
    const smooth = h("input", { type: "checkbox", id: "smooth", checked: query.get("smooth") !== "no" });
    const button = h("button", { class: "primary" }, "Show forces");
    const form = h(
      "form",
      { class: "card", novalidate: true },
      h("h2", null, "A recording of a campaign"),
      h("div", { class: "fields broad" }, picker.fields, field("Observer", how, { name: "method" })),
      h("label", { class: "check", for: "smooth" }, smooth, "each sample given the whole record (a live one knows its past only)"),
      h("p", null, button),
    );
    form.addEventListener(
      "submit",
      busy(button, () => {
        keep({ campaign: picker.which.value, recording: picker.recording.value, method: how.value, smooth: smooth.checked ? null : "no" });
        const body = {
          machine: here.id,
          campaign: picker.which.value,
          recording: picker.recording.value,
          method: how.value,
          smooth: smooth.checked,
        };
        return asked(form, picker.recording.value, (headers) => send("POST", "forces", { json: body, headers }));
      }),
    );
    forms.push(form);
  }
  if (toolings.length) forms.push(uploadForm(here, toolings, method(), asked));
  add(columns, forms);

  async function asked(form, name, ask) {
    clearFaults(form);
    fill(answer, waiting("computing forces …"));
    try {
      const found = await (await ask({})).json();
      forceResults(answer, found, name, async () => save("FORCES.csv", await (await ask({ Accept: "text/csv" })).blob()));
      answer.scrollIntoView({ block: "nearest", behavior: "smooth" });
    } catch (error) {
      fill(answer);
      if (!(error instanceof Problem)) throw error;
      showProblem(form, error);
    }
  }
  if (query.get("recording") && forms[0] && picker.any) forms[0].requestSubmit();
}

function uploadForm(here, toolings, method, asked) {
  const recording = h("input", { type: "file" });
  const air = h("input", { type: "file" });
  const tooling = select(
    toolings.map((t) => [t.name, t.name]),
    toolings[0].name,
  );
  const speed = quantity("Speed as programmed", "speed", null, { name: "spindle_speed_rpm", hint: "Empty: from the trigger" });
  const rate = quantity("Sampling rate", "hertz", null, { name: "sampling_rate_hz", hint: "For files that carry none" });
  const button = h("button", null, "Upload and show");
  const form = h(
    "form",
    { class: "card", novalidate: true },
    h("h2", null, "A file"),
    h(
      "div",
      { class: "fields broad" },
      field("Recording", recording, { name: "recording" }),
      field("In the air", air, { name: "air", hint: "Gives the run-out; may be left out" }),
      field("Tooling", tooling, { name: "tooling" }),
      speed,
      rate,
      field("Observer", method, { name: "method" }),
    ),
    h("p", null, button),
  );
  form.addEventListener(
    "submit",
    busy(button, () => {
      const file = recording.files[0];
      if (!file)
        return showProblem(
          form,
          problemOf(
            0,
            JSON.stringify({ detail: "no file", errors: [{ field: "recording", found: "nothing", allowed: "A recording is needed" }] }),
          ),
        );
      const query = { machine: here.id, tooling: tooling.value, method: method.value };
      if (speed.input.base !== null) query.spindle_speed_rpm = speed.input.base;
      if (rate.input.base !== null) query.sampling_rate_hz = rate.input.base;
      return asked(form, file.name, (headers) => {
        const body = new FormData();
        body.append("query", new Blob([JSON.stringify(query)], { type: "application/json" }));
        body.append("recording", file);
        if (air.files[0]) body.append("air", air.files[0]);
        return send("POST", "forces", { body, headers });
      });
    }),
  );
  return form;
}
