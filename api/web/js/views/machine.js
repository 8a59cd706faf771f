// One machine: what is known of it, where that comes from, and what one can do next.
import { get, getText, Problem, send } from "../api.js";
import { add, card, fill, h, head, link, mark, note, save } from "../dom.js";
import { chart, legend, SERIES } from "../charts.js";
import { across, frfFigure } from "../figures.js";
import { confirmed, failed } from "../forms.js";
import { nextStep } from "../next_step.js";
import { go, to } from "../router.js";
import { allMachines } from "../state.js";
import { plain } from "../units.js";
import { trail } from "./changes.js";
import { contentsOf } from "./forgotten.js";
import { coupling, learned, modesCards, notes } from "./modes.js";

const JSON_TYPE = "application/json";
const CSV = "text/csv";

export function statusMark(machine) {
  const known = machine.identification;
  if (!known) return mark("idle", "not identified");
  return mark({ converged: "good", measured: "good", "not validated": "doubt", suspect: "doubt" }[known.status] ?? "bad", known.status);
}

export async function view({ id }, _query, place) {
  const machine = await get(`machines/${id}`);
  const fault = h("div");
  const known = machine.identification;
  add(
    place,
    head(
      machine.name,
      machine.description,
      statusMark(machine),
      known?.axes.length ? link(to("change", { machine: id }), "Tool change", "button primary") : null,
      link(to(`machines/${id}/recordings`), "Recordings", "button"),
      h("button", { type: "button", class: "quiet danger", onclick: () => forget(machine, fault) }, "Forget"),
    ),
    fault,
  );
  if (!known) {
    add(
      place,
      await nextStep(
        machine,
        "It takes ordinary stable cuts, recorded with the displacement sensor at the flange: two toolings, twenty to forty speeds each, and each speed in the air as well.",
      ),
      upload(machine, fault),
    );
    return;
  }
  // a flange that was measured has a receptance, and no modes
  const measured = known.status === "measured";
  const modes = measured ? null : await get(`machines/${id}/identification/modes`);
  add(
    place,
    known.reasons.length
      ? note(known.status === "failed" ? "bad" : "doubt", h("strong", null, `The identification is ${known.status}`), ...known.reasons)
      : null,
    modes && coupling(modes),
  );
  if (known.axes.length) {
    const picture = chart("The spindle's receptance at its flange", "frf");
    const told = h("p", { class: "small soft" });
    const keys = h("div");
    const direct = known.axes.map((axis, k) => ({ name: `${axis} direction`, series: SERIES[k] }));
    fill(keys, legend(direct));
    add(
      place,
      h(
        "div",
        { class: modes ? "split" : "view" },
        modes && h("div", { class: "view" }, learned(modes), modesCards(modes)),
        h(
          "div",
          { class: "view" },
          card(
            "Receptance at the flange",
            null,
            keys,
            picture,
            h(
              "p",
              { class: "small soft" },
              modes
                ? "Machine and spindle alone, without a tool-holder. Shaded: 95 % band."
                : "Machine and spindle alone, as they were measured: taken for exact.",
            ),
            told,
          ),
          modes && notes(modes),
        ),
      ),
    );
    // nothing is known of a measurement beyond its ends
    const first = measured ? "" : `?from_hz=${Math.max(50, known.band_hz[0] * 0.5)}`;
    get(`machines/${id}/identification/frf${first}`)
      .then((frf) => {
        const crossed = across(frf).map(([name], k) => ({ name, series: SERIES[direct.length + k], dash: "dash" }));
        if (crossed.length) fill(keys, legend([...direct, ...crossed]));
        const rpm = frf.spindle_speed_rpm;
        fill(
          told,
          crossed.length ? "XY: motion in X under a force in Y. " : null,
          rpm ? `At ${plain(rpm)} rev/min, the middle of the speeds that were cut: it changes with the speed.` : null,
        );
        return picture.draw(() => frfFigure([{ ...frf, tooling: machine.name }], { parts: "polar", shown: "both" }));
      })
      .catch((error) => fill(picture, note("bad", error.message)));
  }
  const file = measured ? "FLANGE.csv" : "RESULT.json";
  add(
    place,
    card(
      "Files",
      null,
      h(
        "div",
        { class: "row-of-buttons" },
        h(
          "button",
          {
            type: "button",
            onclick: async () => {
              try {
                const kind = measured ? CSV : JSON_TYPE;
                save(file, await getText(`machines/${id}/identification`, kind), kind);
              } catch (error) {
                failed(fault, error);
              }
            },
          },
          file,
        ),
        link(to("identification"), "All identifications", "button"),
      ),
    ),
    upload(machine, fault),
    card("Versions of the identification", null, await trail({ kind: "identification", name: id })),
  );
}

/** A result or a measured flange from the command line, for a machine. */
function upload(machine, fault) {
  const input = h("input", { type: "file", accept: `.json,.csv,${JSON_TYPE},${CSV}`, id: "result-file" });
  input.addEventListener("change", async () => {
    const file = input.files[0];
    if (!file) return;
    try {
      const kind = /\.csv$/i.test(file.name) ? CSV : JSON_TYPE;
      await send("PUT", `machines/${machine.id}/identification`, { body: file, headers: { "Content-Type": kind } });
      await allMachines(true);
      window.dispatchEvent(new Event("refresh"));
    } catch (error) {
      failed(fault, error);
      if (!(error instanceof Problem)) console.error(error);
    }
  });
  return h(
    "details",
    null,
    h("summary", null, "Take over a result or a measured flange from the command line"),
    h(
      "div",
      { class: "field" },
      h(
        "label",
        { for: "result-file" },
        "RESULT.json of ",
        h("code", null, "rcsa-ident identify"),
        ", or FLANGE.csv of ",
        h("code", null, "rcsa-ident decouple"),
      ),
      input,
      h("div", { class: "hint" }, "Hammer tests that it takes come from ", link(to("tap"), "raw hits"), "."),
    ),
  );
}

async function forget(machine, fault) {
  try {
    for (;;) {
      const there = await get(`machines/${machine.id}/contents`);
      if (!(await confirmed(`Forget ${machine.name}?`, contentsOf(there), "Forget it"))) return;
      const path = machine.example ? "examples/campaign?own=true" : `machines/${machine.id}`;
      try {
        await send("DELETE", path, { headers: { "If-Match": `"${there.etag}"` } });
        break;
      } catch (error) {
        // something has come since then: it is named, too, before it goes
        if (error.status !== 412) throw error;
      }
    }
    await allMachines(true);
    go("");
  } catch (error) {
    failed(fault, error);
  }
}
