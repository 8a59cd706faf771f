// From a campaign to its identification.
import { get, once, post, Problem } from "../api.js";
import { card, h } from "../dom.js";
import { busy, failed, field, quantity, select } from "../forms.js";
import { go } from "../router.js";

/** What an identification would use, in words. */
function source({ usable, cuts, hammer_tests }) {
  const tested = hammer_tests.filter((test) => test.file.uploaded).length;
  const parts = [...(cuts.length ? [`${usable} usable cuts`] : []), ...(tested ? [`${tested} hammer tests`] : [])];
  return parts.join(" and ");
}

/** What the last identification that was completed took on this service, in words. */
async function lasted() {
  const job = (await get("identifications?limit=20")).items.find((each) => each.state === "done" && each.started);
  return job ? `; the last one took ${Math.ceil((new Date(job.finished) - new Date(job.started)) / 1000)} s` : "";
}

/** The next step, and what may be set for it. */
export function identifyCard(campaign) {
  const seed = quantity("Seed", "none", 1, { name: "seed", hint: "The same seed gives the same result." });
  const method = select(
    [
      ["default", "Default"],
      ["paper", "As in the paper"],
    ],
    "default",
  );
  const apply = h("input", { type: "checkbox", checked: true, id: "apply" });
  const start = h("input", { type: "checkbox", id: "start" });
  // until there are enough, more recordings are the next step
  const button = h("button", { class: campaign.too_few ? null : "primary" }, "Identify the machine");
  const time = h("span");
  lasted().then(
    (words) => time.append(words),
    () => {}, // what it takes is no reason to say what is wrong
  );
  const form = h(
    "form",
    { novalidate: true, class: "view" },
    h(
      "div",
      { class: "row-of-buttons" },
      button,
      h("span", { class: "soft" }, `from ${source(campaign)}`, time),
    ),
    campaign.too_few ? h("p", { class: "soft" }, campaign.too_few) : null,
    h(
      "details",
      null,
      h("summary", null, "Settings"),
      h(
        "div",
        { class: "fields" },
        seed,
        field("Method", method, { name: "method" }),
        h("label", { class: "check", for: "apply" }, apply, "the machine takes the result"),
        h("label", { class: "check", for: "start" }, start, "go on from the machine's last result"),
      ),
    ),
  );
  form.addEventListener(
    "submit",
    busy(button, async () => {
      try {
        const job = await post(
          "identifications",
          { campaign: campaign.id, seed: seed.input.base, method: method.value, start: start.checked, apply: apply.checked },
          { headers: once() },
        );
        window.dispatchEvent(new Event("job-begun"));
        go(`identifications/${job.id}`);
      } catch (error) {
        failed(form, error);
        if (!(error instanceof Problem)) throw error;
      }
    }),
  );
  return card(null, null, form);
}
