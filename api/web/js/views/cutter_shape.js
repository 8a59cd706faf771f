// The cutter's shape in the editor of a tooling: it asks only for what draws the shape that is chosen.
import { fill, h } from "../dom.js";
import { field, quantity, select } from "../forms.js";
import { SHAPES } from "./tooling_start.js";

// [key, label, kind, hint]
const DIMENSIONS = [
  ["corner_radius_mm", "Corner radius", "length", "Empty: sharp, or not known"],
  ["cutting_edge_angle_deg", "Cutting edge angle", "degree", "KAPR, from the floor to the edge"],
  ["taper_deg", "Angle from the axis", "degree", "Taper of each side"],
  ["largest_diameter_mm", "Largest diameter", "length", "DCX, where the edge ends"],
  ["cutting_depth_mm", "Edge height", "length", "APMX, from the tip to its end"],
  ["wiper_mm", "Wiper", "length", "BS, the flat beside the corner"],
  ["profile_radius_mm", "Profile radius", "length", "Of the long arc"],
  ["axial_distance_mm", "Axial distance", "length", "From the tip to where it is widest"],
  ["upper_radius_mm", "Upper radius", "length", "At the edge's upper end"],
  ["tip_diameter_mm", "Tip diameter", "length", "Of the floor; empty: a point or a ball"],
  ["neck_diameter_mm", "Neck diameter", "length", "Behind the ball"],
  ["tip_length_mm", "Tip length", "length", "Of the straight edge below the arc"],
];
// what draws each shape; those that it cannot do without come first
const ASKED = {
  flat: ["corner_radius_mm"],
  "bull-nose": ["corner_radius_mm"],
  ball: [],
  tapered: ["taper_deg", "corner_radius_mm", "cutting_depth_mm"],
  face: ["cutting_edge_angle_deg", "cutting_depth_mm", "largest_diameter_mm", "corner_radius_mm", "wiper_mm"],
  "high-feed": ["cutting_edge_angle_deg", "cutting_depth_mm", "profile_radius_mm", "corner_radius_mm", "wiper_mm"],
  radius: ["corner_radius_mm", "tip_length_mm"],
  barrel: ["profile_radius_mm", "axial_distance_mm", "cutting_depth_mm", "corner_radius_mm", "upper_radius_mm"],
  lens: ["profile_radius_mm", "corner_radius_mm", "cutting_depth_mm"],
  oval: ["profile_radius_mm", "corner_radius_mm", "cutting_depth_mm"],
  "taper-barrel": [
    "profile_radius_mm",
    "corner_radius_mm",
    "taper_deg",
    "axial_distance_mm",
    "cutting_depth_mm",
    "tip_diameter_mm",
    "upper_radius_mm",
  ],
  lollipop: ["neck_diameter_mm"],
  chamfer: ["taper_deg", "tip_diameter_mm"],
  dovetail: ["taper_deg", "cutting_depth_mm", "corner_radius_mm"],
  profile: ["profile"],
};

// without these a shape cannot be drawn; where two stand together, one of them is enough
const NEEDED = {
  "bull-nose": ["corner_radius_mm"],
  tapered: ["taper_deg"],
  face: ["cutting_edge_angle_deg", ["cutting_depth_mm", "largest_diameter_mm"]],
  "high-feed": [["cutting_edge_angle_deg", "profile_radius_mm"], "cutting_depth_mm"],
  radius: ["corner_radius_mm"],
  barrel: ["profile_radius_mm", "axial_distance_mm", "cutting_depth_mm"],
  lens: ["profile_radius_mm"],
  oval: ["profile_radius_mm", "corner_radius_mm", "cutting_depth_mm"],
  "taper-barrel": ["profile_radius_mm", "corner_radius_mm", "taper_deg", "axial_distance_mm", "cutting_depth_mm"],
  lollipop: ["neck_diameter_mm"],
  chamfer: ["taper_deg"],
  dovetail: ["taper_deg", "cutting_depth_mm"],
  profile: ["profile"],
};

const numbers = (words) =>
  words
    .split(/[;,\s]+/)
    .filter(Boolean)
    .map(Number);
const rows = (points) => (points ?? []).map((point) => point.join(" ")).join(", ");

/** Fields for a cutter's shape; `write` puts what they say into the keys of a cutter. */
export function cutterShape(keys) {
  const shape = select(SHAPES, keys.shape ?? "flat");
  const boxes = new Map();
  for (const [key, label, kind, hint] of DIMENSIONS) boxes.set(key, quantity(label, kind, keys[key] ?? null, { name: `cutter.${key}`, hint }));
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
  // what stands in a file stays asked for, whatever the shape
  const asked = () => ASKED[shape.value] ?? [];
  const lacking = h("div", { role: "status" });
  const label = (key) => boxes.get(key).querySelector("label").textContent.replace(" [mm]", "");
  const told = (key) => (key === "profile" ? points.value.trim() : boxes.get(key).input.base);
  function show() {
    for (const [key, box] of boxes) box.hidden = !asked().includes(key);
    const missing = (NEEDED[shape.value] ?? []).filter((need) => ![need].flat().some(told));
    const words = missing.map((need) => [need].flat().map(label).join(" or ").toLowerCase()).join(" and ");
    fill(lacking, missing.length ? h("p", { class: "note doubt" }, `Without ${words} it is computed as a cylinder.`) : null);
  }
  for (const input of [shape, points, ...[...boxes.values()].map((box) => box.input).filter(Boolean)]) input.addEventListener("input", show);
  show();

  function write(cutter) {
    for (const key of boxes.keys()) delete cutter[key];
    if (shape.value === "flat") delete cutter.shape;
    else cutter.shape = shape.value;
    for (const key of asked()) {
      if (key === "profile") {
        if (points.value.trim()) cutter.profile = points.value.split(/[,;\n]+/).filter((row) => row.trim()).map(numbers);
      } else if (boxes.get(key).input.base) cutter[key] = boxes.get(key).input.base;
    }
    // an edge that ends somewhere ends there in any shape that has an end
    if (keys.cutting_depth_mm && ["flat", "bull-nose", "ball"].includes(shape.value) && shape.value === (keys.shape ?? "flat"))
      cutter.cutting_depth_mm = keys.cutting_depth_mm;
    if (keys.largest_diameter_mm && shape.value === "tapered" && keys.shape === "tapered") cutter.largest_diameter_mm = keys.largest_diameter_mm;
    const waves = { amplitude_mm: amplitude.input.base, wavelength_mm: wavelength.input.base };
    if (waves.amplitude_mm || waves.wavelength_mm) {
      cutter.serration = { ...wave };
      for (const [key, value] of Object.entries(waves)) if (value) cutter.serration[key] = value;
      else delete cutter.serration[key];
    } else delete cutter.serration;
  }
  const boxOfShape = field("Shape", shape, { name: "cutter.shape", hint: "What the edges sweep over" });
  const parts = [
    h("div", { class: "fields" }, boxOfShape, ...boxes.values()),
    lacking,
    h(
      "details",
      { open: Boolean(keys.serration) },
      h("summary", null, "Waves along the edges, as roughers have"),
      h("div", { class: "fields" }, amplitude, wavelength),
    ),
  ];
  return { parts, write };
}
