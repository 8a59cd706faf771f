// After a tool change: what is asked on the left, what it means for the cut on the right.
import { all, get } from "../api.js";
import { add, empty, head, link } from "../dom.js";
import { nextStep } from "../next_step.js";
import { remember, to } from "../router.js";
import { machine } from "../state.js";
import { changeForm, toolingPicks } from "./change_form.js";
import { methods } from "./change_question.js";
import { lobesBench } from "./lobes_bench.js";

export async function view(_args, query, place) {
  const [toolings, { items: materials }, kinds] = await Promise.all([all("toolings"), get("materials"), methods()]);
  const here = machine();
  add(place, head("Tool change", "Tooltip FRF and stability lobes of any tooling, also one that never cut."));
  if (!here?.identification?.axes.length) return void add(place, await nextStep(here, "After that every tooling has its lobes."));
  if (!toolings.length) {
    return void add(
      place,
      empty(
        "No tooling yet",
        "Draw one, import a tool library, or drop tooling files in.",
        link(to("toolings"), "To the toolings", "button primary"),
      ),
    );
  }
  const on = { machine: here.id };
  const subject = {
    ...toolingPicks(toolings, query, () => bench.changed(true)),
    body: () => on,
    address: () => on,
    // a measured flange says nothing of a workpiece
    material: here.identification.status === "measured" ? null : "As in the identification",
    temperatures: here.identification.temperature_c,
    shaped: toolings.some((tooling) => tooling.shape !== "flat"),
  };
  const form = changeForm({ subject, materials, kinds, query, onchange: (now) => bench.changed(now) });
  const bench = lobesBench({ form, toolings: () => toolings, query, keep: (state) => remember("change", state) });
  add(place, bench.element);
  bench.begin();
  return bench.end;
}
