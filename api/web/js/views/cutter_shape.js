// The cutter's shape in the editor of a tooling: it asks only for what draws the shape that is chosen.
import { fill, h } from "../dom.js";
import { declaredField, field, quantity, select } from "../forms.js";
import { SHAPES } from "./tooling_start.js";

// what a corner radius is of, where it is no corner that may be left out
const CORNERS = {
  "bull-nose": "RE, from floor to wall",
  radius: "Of the hollow arc",
  oval: "Of the ball at the tip",
  "taper-barrel": "Of the ball at the tip",
  ball: "Half of the diameter",
  lollipop: "Half of the diameter",
};
/**
 * What each shape is drawn by, as the service has it (`rcsa_ident.cutting.outlines`): it cannot do without what it needs, where two stand
 * together without one of them; it may have more; and some is shown only where a file tells it.
 */
export const TAKES = {
  flat: { may: ["corner_radius_mm"], told: ["cutting_depth_mm"] },
  "bull-nose": { needs: [["corner_radius_mm"]], told: ["cutting_depth_mm"] },
  ball: { told: ["corner_radius_mm", "cutting_depth_mm"] },
  tapered: { needs: [["taper_deg"]], may: ["corner_radius_mm", "cutting_depth_mm"], told: ["largest_diameter_mm"] },
  face: { needs: [["cutting_edge_angle_deg"], ["cutting_depth_mm", "largest_diameter_mm"]], may: ["corner_radius_mm", "wiper_mm"] },
  "high-feed": {
    needs: [
      ["cutting_edge_angle_deg", "profile_radius_mm"],
      ["cutting_depth_mm", "largest_diameter_mm"],
    ],
    may: ["corner_radius_mm", "wiper_mm"],
  },
  radius: { needs: [["corner_radius_mm"]], may: ["tip_length_mm"] },
  barrel: { needs: [["profile_radius_mm"], ["axial_distance_mm"], ["cutting_depth_mm"]], may: ["corner_radius_mm", "upper_radius_mm"] },
  lens: { needs: [["profile_radius_mm"]], may: ["corner_radius_mm", "cutting_depth_mm"] },
  oval: { needs: [["profile_radius_mm"], ["corner_radius_mm"], ["cutting_depth_mm"]] },
  "taper-barrel": {
    needs: [["profile_radius_mm"], ["corner_radius_mm"], ["taper_deg"], ["axial_distance_mm"], ["cutting_depth_mm"]],
    may: ["tip_diameter_mm", "upper_radius_mm"],
  },
  lollipop: { needs: [["neck_diameter_mm"]], told: ["corner_radius_mm"] },
  chamfer: { needs: [["taper_deg"]], may: ["tip_diameter_mm"] },
  dovetail: { needs: [["taper_deg"], ["cutting_depth_mm"]], may: ["corner_radius_mm"] },
  profile: { needs: [["profile"]], told: ["corner_radius_mm"] },
};

const numbers = (words) =>
  words
    .split(/[;,\s]+/)
    .filter(Boolean)
    .map(Number);
const rows = (points) => (points ?? []).map((point) => point.join(" ")).join(", ");

/** Fields for a cutter's shape of the declared keys; `write` puts what they say into the keys of a cutter. */
export function cutterShape(declared, keys) {
  const shape = select(SHAPES, keys.shape ?? "flat");
  const boxes = new Map();
  for (const each of declared.filter(({ label, needed }) => label && !needed)) boxes.set(each.key, declaredField(each, "cutter", keys[each.key]));
  const points = h("textarea", { rows: 3, autocomplete: "off", spellcheck: "false", placeholder: "0 0, 5 0, 8 3 3, 8 20" });
  points.value = rows(keys.profile);
  boxes.set(
    "profile",
    field("Points of the outline [mm]", points, {
      name: "cutter.profile",
      hint: "r and z from the tip up, with commas; a third number is the radius of the arc to the point, below 0 where it is hollow",
      double: true,
    }),
  );
  const wave = keys.serration ?? {};
  const amplitude = quantity("Wave amplitude", "length", wave.amplitude_mm ?? null, {
    name: "cutter.serration.amplitude_mm",
    hint: "Of a rougher's edges; empty: smooth",
  });
  const wavelength = quantity("Wavelength", "length", wave.wavelength_mm ?? null, { name: "cutter.serration.wavelength_mm", hint: "Along the axis" });
  const takes = () => ({ needs: [], may: [], told: [], ...TAKES[shape.value] });
  const inFile = (key) => shape.value === (keys.shape ?? "flat") && (keys[key] ?? null) !== null;
  const asked = () => [...takes().needs.flat(), ...takes().may, ...takes().told.filter(inFile)];
  const boxOfShape = field("Shape", shape, { name: "cutter.shape", hint: "What the edges sweep over" });
  const lacking = h("div", { role: "status" });
  const label = (key) => boxes.get(key).querySelector("label").textContent.replace(" [mm]", "");
  const told = (key) => (key === "profile" ? points.value.trim() : boxes.get(key).input.base);
  /** Fields of the shape that is chosen, what it needs first. */
  function ask() {
    for (const box of boxes.values()) box.remove();
    boxOfShape.after(...asked().map((key) => boxes.get(key)));
    boxes.get("corner_radius_mm").querySelector(".hint").textContent = CORNERS[shape.value] ?? "Empty: sharp, or not known";
    show();
  }
  function show() {
    const missing = takes().needs.filter((need) => !need.some(told));
    const words = missing.map((need) => need.map(label).join(" or ").toLowerCase());
    const last = words.pop();
    const all = words.length ? `${words.join(", ")} and ${last}` : last;
    fill(lacking, last ? h("p", { class: "note doubt" }, `Without ${all} it is computed as a cylinder.`) : null);
  }
  for (const input of [points, ...[...boxes.values()].map((box) => box.input).filter(Boolean)]) input.addEventListener("input", show);
  shape.addEventListener("input", ask);

  function write(cutter) {
    for (const key of boxes.keys()) delete cutter[key];
    if (shape.value === "flat") delete cutter.shape;
    else cutter.shape = shape.value;
    for (const key of asked()) {
      if (key === "profile") {
        if (points.value.trim()) cutter.profile = points.value.split(/[,;\n]+/).filter((row) => row.trim()).map(numbers);
      } else if (boxes.get(key).input.base) cutter[key] = boxes.get(key).input.base;
    }
    const waves = { amplitude_mm: amplitude.input.base, wavelength_mm: wavelength.input.base };
    if (waves.amplitude_mm || waves.wavelength_mm) {
      cutter.serration = { ...wave };
      for (const [key, value] of Object.entries(waves)) if (value) cutter.serration[key] = value;
      else delete cutter.serration[key];
    } else delete cutter.serration;
  }
  const parts = [
    h("div", { class: "fields" }, boxOfShape),
    lacking,
    h(
      "details",
      { open: Boolean(keys.serration) },
      h("summary", null, "Waves along the edges, as roughers have"),
      h("div", { class: "fields" }, amplitude, wavelength),
    ),
  ];
  ask();
  return { parts, write };
}
