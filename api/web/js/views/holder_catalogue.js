// Holders of the catalogue: a taper and a chuck become the segments of a holder and a typical contact, with where they come from.
import { get, part } from "../api.js";
import { fill, h, note } from "../dom.js";
import { busy, field, quantity, select } from "../forms.js";
import { plain } from "../units.js";

/** Where one is chosen; `shank()` is the diameter that it has to hold [mm], `take(found, taper)` gets the one made. */
export function catalogueBox(shank, take) {
  const place = h("div", { class: "view" });
  const box = h("details", null, h("summary", null, "Take one from the catalogue"), place);
  box.addEventListener("toggle", () => box.open && !place.childElementCount && choices(place, shank, take).catch((error) => tell(place, error)));
  return box;
}

async function choices(place, shank, take) {
  const { tapers, chucks } = await get("holders");
  const taper = select(
    tapers.map((name) => [name, name]),
    tapers[0],
  );
  const kinds = chucks.map(({ name, least_bore_mm: least, largest_bore_mm: most }) => [name, `${name}: ${plain(least, 1)} to ${plain(most, 1)} mm`]);
  const holds = chucks.find(({ least_bore_mm: least, largest_bore_mm: most }) => least <= shank() && shank() <= most);
  const chuck = select(kinds, (holds ?? chucks[0]).name);
  const length = quantity("Length", "length", null, { hint: "Nose to spindle face or gauge line. Empty: a typical one" });
  const told = h("div", { role: "status" });
  const button = h("button", { type: "button" }, "Take this holder");
  button.addEventListener(
    "click",
    busy(button, async () => {
      const asked = new URLSearchParams({ bore_mm: shank() });
      if (length.input.base !== null) asked.set("length_mm", length.input.base);
      try {
        const found = await get(`holders/${part(taper.value)}/${part(chuck.value)}?${asked}`);
        take(found, taper.value);
        const made = `${found.name} for a shank of ${plain(shank(), 2)} mm, ${plain(found.mass_kg, 2)} kg.`;
        fill(told, note("good", made, ...found.sources), worth(found.contact));
      } catch (error) {
        tell(told, error);
      }
    }),
  );
  fill(
    place,
    h("div", { class: "fields broad" }, field("Taper", taper), field("Chuck, and the shanks that it takes", chuck), length),
    h("div", { class: "row-of-buttons" }, button),
    told,
  );
}

/** What the contact is worth, in words. */
function worth(contact) {
  if (!contact)
    return note("doubt", "No typical contact is known of this chuck: the one below is as it was. A hit on the tip of the clamped tool tells it.");
  const { kind, source, stiffness_spread_percent: stiffness, damping_spread_percent: damping } = contact;
  const spreads = `standard deviation of its stiffness ${plain(stiffness, 0)} %, of its damping ${plain(damping, 0)} %`;
  return note("doubt", `The contact below is now the typical one, ${kind}: ${source} (${spreads}; the card below the contact states them). A hit on the tip of the clamped tool tells it better.`);
}

const tell = (place, error) =>
  fill(place, note("bad", ...(error.errors?.length ? error.errors.map((e) => `${e.field}: found ${e.found}, allowed ${e.allowed}`) : [error.message])));
