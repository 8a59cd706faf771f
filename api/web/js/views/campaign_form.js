// A campaign described by hand, for recordings that come without a campaign.toml.
import { all, once, post, Problem } from "../api.js";
import { add, card, empty, fill, h, head, labelled, link, tableFrame } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, field, quantity, select, showProblem } from "../forms.js";
import { go, holdsEdits, to } from "../router.js";
import { allMachines, choose, machine } from "../state.js";
import { quantityInput, u } from "../units.js";
import { queueFor } from "../uploads.js";
import { DIRECTIONS, STRATEGIES } from "./change_question.js";
import { targetMachine } from "./target_machine.js";

const SENSOR = [["Channel"], ["Measures"], ["Axis"], ["Sensitivity"], ["Behind the flange", "depth"]];

let kept = [];

/** Recordings that were dropped before anybody described them. */
export function keepFiles(files) {
  kept = files;
}

const isAir = (name) => /(^|[_\-. ])air([_\-. ]|$)/i.test(name.replace(/\.[^.]+$/, ""));
const base = (name) => name.replace(/\.[^.]+$/, "").replace(/(^|[_\-. ])(air|cut)(?=[_\-. ]|$)/gi, "");

/** Cuts as the names of the files tell them: pairs of cut and air, and a speed where a number can be one. */
export function cutsOf(names) {
  const airs = new Map(names.filter(isAir).map((name) => [base(name), name]));
  return names
    .filter((name) => !isAir(name))
    .sort()
    .map((name) => {
      const found = [...base(name).matchAll(/\d{3,6}/g)].map(Number).find((n) => n >= 500 && n <= 100_000);
      return { id: base(name) || name, cut: name, air: airs.get(base(name)) ?? "", speed: found ?? null };
    });
}

/** Angles from the normal direction for a radial immersion (a share of the diameter). */
export function angles(immersion, strategy) {
  const reach = (Math.acos(1 - 2 * immersion) * 180) / Math.PI;
  return strategy === "up" ? [0, reach] : [180 - reach, 180];
}

export async function view(_args, _query, place) {
  const [, toolings] = await Promise.all([allMachines(), all("toolings")]);
  const here = machine();
  add(place, head("Describe the cuts", "For recordings without a campaign.toml."));
  if (!toolings.length)
    return void add(
      place,
      empty(
        "No tooling yet",
        "An identification has to know what was in the spindle.",
        link(to("toolings/new"), "Draw the tooling", "button primary"),
      ),
    );

  const files = kept;
  const name = h("input", { autocomplete: "off", maxlength: 200 });
  name.value = `${here && !here.example ? here.name : "Cuts"}, ${new Date().toISOString().slice(0, 10)}`;
  const target = targetMachine("Machine 1");
  const rate = quantity("Sampling rate", "hertz", null, { name: "campaign.sampling_rate_hz", hint: "For files that carry none" });
  const material = h("input", { autocomplete: "off" });
  material.value = "EN AW-6082";
  const ktc = quantity("Tangential coefficient", "pressure", 902, { name: "workpiece.tangential_coefficient_mpa" });
  const krc = quantity("Radial over tangential", "none", 0.26, { name: "workpiece.radial_ratio", double: true });
  const common = {
    tooling: select(
      toolings.map((t) => [t.name, t.name]),
      toolings[0].name,
    ),
    depth: quantity("Axial depth", "depth", 0.4, { name: "axial_depth_mm" }),
    feed: quantity("Feed per tooth", "feed", 0.1, { name: "feed_per_tooth_mm" }),
    immersion: quantity("Radial immersion", "percent", 50),
    strategy: select(STRATEGIES, "down"),
    direction: select(DIRECTIONS, "+X"),
  };
  const first = quantity("First speed", "speed", null, { hint: "Fills the speeds below" });
  const step = quantity("Step", "speed", null);
  const sensors = h("tbody");
  for (const [channel, kind, axis] of [
    ["flange_x", "displacement", "X"],
    ["flange_y", "displacement", "Y"],
    ["fixture_x", "acceleration", "X"],
    ["fixture_y", "acceleration", "Y"],
  ])
    sensors.append(sensorRow(channel, kind, axis));
  const body = h("tbody");
  const count = h("p", { class: "soft", role: "status" });
  const button = h("button", { class: "primary" }, "Make the campaign and upload");
  const form = h(
    "form",
    { class: "view", novalidate: true },
    card(
      "Campaign",
      null,
      h("div", { class: "fields" }, field("Name", name, { name: "campaign.name", double: true }), rate),
      h("div", { class: "fields broad" }, target.fields),
      target.remark,
    ),
    card(
      "Sensors",
      null,
      h(
        "p",
        { class: "small soft" },
        "Channels by their names in the recordings. Sensitivity in V/m or V/(m/s²); 1 where the file is in SI. Leave a name empty for a channel that is not there. Behind the flange: from the face between holder and spindle to the spot that a displacement sensor looks at, towards the spindle's rear; below 0 on the holder. A ruler is enough.",
      ),
      tableFrame(
        "Sensors",
        SENSOR.map(([name, kind]) => ({ name, unit: kind && u(kind) })),
        sensors,
      ),
    ),
    card("Workpiece", null, h("div", { class: "fields" }, field("Material", material, { name: "workpiece.name" }), ktc, krc)),
    card(
      "All cuts",
      null,
      h(
        "div",
        { class: "fields" },
        field("Tooling", common.tooling, { double: true }),
        common.depth,
        common.feed,
        common.immersion,
        field("Strategy", common.strategy),
        field("Feed direction", common.direction),
        first,
        step,
      ),
    ),
    card(
      "Each cut",
      null,
      dropZone("Drop recordings here", "Names that hold “air” are air cuts of the cut of the same name.", take, { small: true }),
      count,
      tableFrame("Cuts", [{ name: "Cut" }, { name: "Speed", unit: u("speed") }, { name: "Tooling" }, { name: "Air cut" }], body, { tall: true }),
    ),
    h("p", null, button),
  );
  add(place, form);
  const taken = new Map();

  function take(more) {
    for (const file of more) taken.set(file.name, file);
    const names = [...taken.keys()];
    const before = new Map([...body.children].map((tr) => [tr.cut.cut, tr]));
    body.replaceChildren(...cutsOf(names).map((cut, i) => before.get(cut.cut) ?? cutRow(cut, i, names.filter(isAir))));
    [...body.children].forEach((tr, i) => (tr.children[1].dataset.field = `cuts.${i}.spindle_speed_rpm`));
    fill(count, names.length ? `${body.children.length} cuts, ${names.filter(isAir).length} air cuts` : "");
  }
  function cutRow(cut, i, airs) {
    const speed = quantityInput("speed", cut.speed, { "aria-label": `Speed of ${cut.id}` });
    const tooling = select([["", "as above"], ...toolings.map((t) => [t.name, t.name])], "", { "aria-label": `Tooling of ${cut.id}` });
    const air = select([["", "none"], ...airs.map((a) => [a, a])], cut.air, { "aria-label": `Air cut of ${cut.id}` });
    const tr = h(
      "tr",
      { role: "row" },
      labelled(h("th", { scope: "row", role: "rowheader" }, cut.id), "Cut"),
      labelled(h("td", { role: "cell" }, speed, h("div", { class: "fault", id: `cut-${i}-fault`, hidden: true })), "Speed", u("speed")),
      labelled(h("td", { role: "cell" }, tooling), "Tooling"),
      labelled(h("td", { role: "cell" }, air), "Air cut"),
    );
    Object.assign(tr, { cut, speed, tooling, air });
    return tr;
  }
  const spread = () => {
    const start = first.input.base;
    if (start === null) return;
    [...body.children].forEach((tr, i) => (tr.speed.base = start + i * (step.input.base ?? 0)));
  };
  first.input.addEventListener("input", spread);
  step.input.addEventListener("input", spread);
  take(files);
  let edited = false;
  form.addEventListener("input", () => (edited = true));
  holdsEdits(() => edited || taken.size > 0);

  form.addEventListener(
    "submit",
    busy(button, async () => {
      const rows = [...body.children];
      if (!rows.length) return void showProblem(form, new Problem(0, { detail: "There are no recordings yet: drop some in." }));
      const [entry, exit] = angles(common.immersion.input.base / 100, common.strategy.value);
      const made = {
        campaign: { name: name.value.trim(), ...(rate.input.base === null ? {} : { sampling_rate_hz: rate.input.base }) },
        sensors: Object.fromEntries(
          [...sensors.children]
            .filter((tr) => tr.inputs.channel.value.trim())
            .map((tr) => [
              tr.inputs.channel.value.trim(),
              {
                quantity: tr.inputs.kind.value,
                axis: tr.inputs.axis.value,
                sensitivity: tr.inputs.sensitivity.base,
                ...(told(tr.inputs) ? { distance_behind_flange_mm: tr.inputs.distance.base } : {}),
              },
            ]),
        ),
        workpiece: { name: material.value.trim(), tangential_coefficient_mpa: ktc.input.base, radial_ratio: krc.input.base },
        cuts: rows.map((tr) => ({
          id: tr.cut.id,
          tooling: tr.tooling.value || common.tooling.value,
          spindle_speed_rpm: tr.speed.base,
          axial_depth_mm: common.depth.input.base,
          feed_per_tooth_mm: common.feed.input.base,
          entry_angle_deg: entry,
          exit_angle_deg: exit,
          feed_direction: common.direction.value,
          cut: tr.cut.cut,
          ...(tr.air.value ? { air: tr.air.value } : {}),
        })),
      };
      try {
        const id = await target.id();
        await allMachines(true);
        const campaign = await post(`machines/${id}/campaigns`, made, { headers: once() });
        choose(id);
        queueFor(campaign.id).add(campaign, [...taken.values()]);
        kept = [];
        holdsEdits(() => false);
        go(`campaigns/${campaign.id}`);
      } catch (error) {
        if (!(error instanceof Problem)) throw error;
        showProblem(form, error);
      }
    }),
  );
}

/** Whether a row tells how far behind the flange its sensor looks. */
function told(inputs) {
  return inputs.kind.value === "displacement" && inputs.distance.base !== null;
}

function sensorRow(channel, kind, axis) {
  const inputs = {
    channel: h("input", { "aria-label": "Channel", autocomplete: "off" }),
    kind: select(["displacement", "acceleration"].map((each) => [each, each]), kind, { "aria-label": "Measures" }),
    axis: select(["X", "Y"].map((each) => [each, each]), axis, { "aria-label": "Axis" }),
    sensitivity: quantityInput("none", 1, { "aria-label": "Sensitivity" }),
    distance: quantityInput("depth", null, { "aria-label": "Behind the flange" }),
  };
  inputs.channel.value = channel;
  const fields = new Map([
    [inputs.sensitivity, "sensitivity"],
    [inputs.distance, "distance_behind_flange_mm"],
  ]);
  const shown = () => (inputs.distance.disabled = inputs.kind.value !== "displacement");
  inputs.kind.addEventListener("change", shown);
  shown();
  const tr = h(
    "tr",
    { role: "row" },
    Object.values(inputs).map((input, k) =>
      labelled(
        h(
          "td",
          { role: "cell", "data-field": fields.has(input) ? `sensors.${channel}.${fields.get(input)}` : "" },
          input,
          fields.has(input) ? h("div", { class: "fault", hidden: true }) : null,
        ),
        SENSOR[k][0],
        SENSOR[k][1] && u(SENSOR[k][1]),
      ),
    ),
  );
  tr.inputs = inputs;
  return tr;
}
