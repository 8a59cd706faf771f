// What a new tooling begins as, and the shapes that a cutter may have.
export const START = {
  cutter: { teeth: 4, diameter_mm: 12, helix_deg: 30 },
  tool: {
    stickout_mm: 60,
    segments: [
      { length_mm: 26, outer_diameter_mm: 9.6, material: "carbide" },
      { length_mm: 74, outer_diameter_mm: 12, material: "carbide" },
    ],
  },
  holder: {
    insertion_mm: 40,
    segments: [
      { length_mm: 40, outer_diameter_mm: 32, inner_diameter_mm: 12, material: "steel" },
      { length_mm: 26, outer_diameter_mm: 63, material: "steel" },
    ],
  },
  // what the catalogue of holders assumes of a collet, and how well it is known
  contact: { translational_stiffness: 2e10, rotational_stiffness: 6e5, translational_damping: 1e5, rotational_damping: 40 },
  spread: { contact_stiffness_percent: 70, contact_damping_percent: 100 },
};
export const SHAPES = [
  ["flat", "flat end"],
  ["bull-nose", "bull nose"],
  ["ball", "ball end"],
  ["tapered", "tapered"],
  ["face", "face mill"],
  ["high-feed", "high feed"],
  ["radius", "hollow radius"],
  ["barrel", "barrel"],
  ["lens", "lens"],
  ["oval", "oval"],
  ["taper-barrel", "tapered barrel"],
  ["lollipop", "lollipop"],
  ["chamfer", "chamfer mill"],
  ["dovetail", "dovetail"],
  ["profile", "own outline"],
];
