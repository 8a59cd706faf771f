// The way from a recommendation to the card that is printed of it.
import { link } from "../dom.js";
import { to, where } from "../router.js";

/** The card of a tooling under the conditions of the address, which are those of the answer beside it. */
export function cardLink(tooling) {
  const query = where().query;
  query.set("tooling", tooling);
  return link(to("card", Object.fromEntries(query)), "Print tool card", "button quiet print");
}
