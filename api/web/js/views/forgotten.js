// What is deleted with a machine or a campaign, by its names, said before it happens.
import { h, note } from "../dom.js";

const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

/** A campaign's recordings: how many, and their names for those who look. */
export const recordingsOf = (names) =>
  names.length
    ? h("details", null, h("summary", null, counted(names.length, "recording")), h("p", { class: "small soft names" }, names.join(", ")))
    : h("div", { class: "soft" }, "no recordings");

/** The contents of a machine, as the service tells them. */
export function contentsOf(there) {
  const mine = there.example ? there.campaigns.filter((each) => !each.example) : [];
  const lines = [
    there.identification && `Its identification (${there.identification})`,
    ...there.campaigns.map((each) => [`Campaign “${each.name}”`, recordingsOf(each.recordings)]),
    there.toolings.length > 0 && `${counted(there.toolings.length, "tooling")}: ${there.toolings.join(", ")}`,
  ].filter(Boolean);
  return h(
    "div",
    { class: "view" },
    mine.length ? note("doubt", `The example holds ${counted(mine.length, "campaign")} of your own: ${mine.map((each) => each.name).join(", ")}.`) : null,
    lines.length ? [h("p", null, "Deleted with it:"), h("ul", null, lines.map((line) => h("li", null, line)))] : h("p", null, "It holds nothing else."),
    h("p", null, "This cannot be undone."),
  );
}
