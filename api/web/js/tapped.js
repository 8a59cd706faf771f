// The FRFs of a tip that somebody looks at: no address can hold them, so that this tab does.
import { Problem } from "./api.js";

const KEY = "rcsa.tapped";
/** Bytes of all FRFs together: what a query takes, with some room for the rest of it. */
const LARGEST = 950_000;

/** FRFs as [{name, text, axes}]; axes are "" where the text itself says them. */
export function tapped() {
  try {
    return JSON.parse(sessionStorage.getItem(KEY)) ?? [];
  } catch {
    return [];
  }
}

/** Keep FRFs while this tab is open. */
export function keepTapped(frfs) {
  const size = new Blob([JSON.stringify(frfs.map((each) => each.text))]).size;
  if (size > LARGEST) throw new Problem(0, { detail: `The FRFs have ${Math.ceil(size / 1000)} kB together; the service takes ${LARGEST / 1000}. Fewer lines are enough: 1 Hz apart, up to some kilohertz.` });
  sessionStorage.setItem(KEY, JSON.stringify(frfs));
}

/** One more FRF, in the place of one of its name or along its axes. */
export function addTapped(frf) {
  const same = (each) => each.name === frf.name || (frf.axes !== "" && each.axes === frf.axes);
  keepTapped([...tapped().filter((each) => !same(each)), frf]);
}
