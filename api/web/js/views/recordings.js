// Campaigns of a machine, and a place to drop another one.
import { all } from "../api.js";
import { add, card, empty, h, head, link, mark, table } from "../dom.js";
import { dropZone } from "../drop.js";
import { tryButton } from "../next_step.js";
import { to } from "../router.js";
import { allMachines, machine } from "../state.js";
import { intake } from "./intake.js";

export async function view({ id = null }, _query, place) {
  const machines = await allMachines();
  const here = id ? machines.find((m) => m.id === id) : machine();
  const campaigns = here ? (await all(`machines/${here.id}/campaigns`)).reverse() : [];
  const box = h("div", { class: "view" });
  add(
    place,
    head("Recordings", here ? `Campaigns of ${here.name}` : null, link(to("campaigns/new"), "Describe cuts by hand", "button")),
    box,
    dropZone(
      "Drop a campaign here",
      "Its folder, a ZIP of it, or its files: campaign.toml, tooling files, recordings (HDF5, TDMS, UFF 58, WAV and other sound, MATLAB, Parquet, CSV), FRFs of hammer tests.",
      (files) => intake(box, files),
    ),
    campaigns.length
      ? campaignTable(campaigns)
      : empty(
          "No campaign yet",
          "A campaign is a folder of recordings of ordinary stable cuts, with a campaign.toml that says at which speeds. Drop one above, describe the cuts by hand, or look first how it goes with an example.",
          tryButton(box, ""),
        ),
  );
}

function campaignTable(campaigns) {
  return card(
    "Campaigns",
    null,
    table(
      "Campaigns",
      [
        { name: "Name", cell: (c) => link(to(`campaigns/${c.id}`), c.name) },
        { name: "Made", cell: (c) => new Date(c.created).toLocaleString() },
        { name: "Cuts", number: true, cell: (c) => String(c.cuts) },
        ...(campaigns.some((c) => c.hammer_tests)
          ? [{ name: "Hammer tests", number: true, cell: (c) => String(c.hammer_tests) }]
          : []),
        { name: "Uploaded", number: true, cell: (c) => String(c.uploaded) },
        { name: "Usable", number: true, cell: (c) => String(c.usable) },
        {
          name: "State",
          cell: (c) => {
            if (c.missing) return mark("idle", c.uploaded < c.cuts || !c.cuts ? "files are missing" : "air cuts are missing");
            if (!c.cuts) return mark("good", "complete");
            if (!c.usable) return mark("bad", "nothing usable");
            return c.without_air ? mark("doubt", "no air cuts") : mark("good", "complete");
          },
        },
      ],
      campaigns,
    ),
  );
}
