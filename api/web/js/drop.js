// Files and folders that are let go over the page, or chosen.
import { add, h, icon } from "./dom.js";

/** Every file of a drop, those in folders, too. */
export async function filesOf(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...transfer.files];
  const found = [];
  await Promise.all(entries.map((entry) => walk(entry, found)));
  return found;
}

async function walk(entry, found) {
  if (entry.isFile) {
    found.push(await new Promise((resolve, reject) => entry.file(resolve, reject)));
    return;
  }
  const reader = entry.createReader();
  // a reader tells a hundred at a time
  for (;;) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) return;
    await Promise.all(some.map((each) => walk(each, found)));
  }
}

/** Take what is let go anywhere over the page, as long as the field for it is there. */
function wholeView(zone, onfiles) {
  let depth = 0;
  const ways = {
    dragenter: () => over((depth += 1)),
    dragleave: () => over((depth -= 1)),
    drop: async (event) => {
      event.preventDefault();
      over((depth = 0));
      onfiles(await filesOf(event.dataTransfer));
    },
  };
  const over = (count) => zone.classList.toggle("over", count > 0);
  for (const [name, way] of Object.entries(ways)) {
    window.addEventListener(name, function heard(event) {
      // a view that was left takes nothing any more; a field for files takes its own
      if (!zone.isConnected) window.removeEventListener(name, heard);
      else if (!event.target.closest?.("input[type=file], dialog")) way(event);
    });
  }
}

/** A field for files that are let go anywhere over the page, with buttons for those who choose them. */
export function dropZone(title, words, onfiles, { small = false, folder: folders = true } = {}) {
  const picked = (input) => {
    if (input.files.length) onfiles([...input.files]);
    input.value = "";
  };
  const files = h("input", {
    type: "file",
    multiple: true,
    class: "unseen",
    tabindex: "-1",
    "aria-hidden": "true",
    onchange: () => picked(files),
  });
  const folder = h("input", {
    type: "file",
    webkitdirectory: true,
    class: "unseen",
    tabindex: "-1",
    "aria-hidden": "true",
    onchange: () => picked(folder),
  });
  const zone = h("section", { class: `drop${small ? " small" : ""}`, "aria-label": title });
  add(
    zone,
    small ? null : icon("drop"),
    h("h2", null, title),
    h("p", { class: "soft" }, words),
    h(
      "div",
      { class: "row-of-buttons" },
      folders ? h("button", { type: "button", class: small ? "" : "primary", onclick: () => folder.click() }, "Choose a folder") : null,
      h("button", { type: "button", class: folders ? "" : "primary", onclick: () => files.click() }, "Choose files"),
    ),
    files,
    folder,
  );
  wholeView(zone, onfiles);
  return zone;
}
