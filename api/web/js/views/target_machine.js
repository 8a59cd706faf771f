// The machine that recordings go to: one of one's own or a new one, never the example, with which they would be deleted.
import { once, post } from "../api.js";
import { h, note } from "../dom.js";
import { field, select } from "../forms.js";
import { knownMachines, machine } from "../state.js";

/** A choice of the machine, with a name proposed for a new one: `fields`, `remark` beside them, and `id()`, which makes a new one. */
export function targetMachine(proposed) {
  const here = machine();
  const own = knownMachines().filter((m) => !m.example);
  const which = select([...own.map((m) => [m.id, m.name]), ["", "A new machine"]], here && !here.example ? here.id : "");
  const called = h("input", { autocomplete: "off", maxlength: 64 });
  called.value = proposed;
  const naming = field("Its name", called, { name: "name" });
  const follow = () => (naming.hidden = which.value !== "");
  which.addEventListener("change", follow);
  follow();
  const id = async () => {
    if (which.value) return which.value;
    const made = await post("machines", { name: called.value.trim(), description: "" }, { headers: once() });
    // where the campaign is refused, the next try finds the machine
    which.prepend(h("option", { value: made.id }, made.name));
    which.value = made.id;
    follow();
    return made.id;
  };
  return {
    fields: [field("Machine", which, { name: "machine" }), naming],
    remark: here?.example ? note("", "The example takes no recordings of your own: they would be deleted with it.") : null,
    id,
  };
}
