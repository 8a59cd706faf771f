// Which machines there are, and which one this person works at.
import { all } from "./api.js";

let machines = null;
let current = null;
try {
  current = localStorage.getItem("rcsa.machine");
} catch {
  // the first one then
}

/** All machines, asked for again where `fresh`. */
export async function allMachines(fresh = false) {
  if (machines === null || fresh) {
    machines = await all("machines");
    window.dispatchEvent(new Event("machines"));
  }
  return machines;
}

export const knownMachines = () => machines ?? [];

/** The machine that this person works at, or null where there is none. */
export function machine() {
  const known = knownMachines();
  return known.find((m) => m.id === current) ?? known.find((m) => !m.example) ?? known[0] ?? null;
}

export function choose(id) {
  if (id === current) return;
  current = id;
  try {
    localStorage.setItem("rcsa.machine", id);
  } catch {
    // for this visit
  }
  window.dispatchEvent(new Event("machines"));
}

export function forgetAll() {
  machines = null;
}
