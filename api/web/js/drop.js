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

/** A field to drop files on, with buttons for those who choose them. */
export function dropZone(title, words, onfiles, { small = false } = {}) {
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
      h("button", { type: "button", class: small ? "" : "primary", onclick: () => folder.click() }, "Choose a folder"),
      h("button", { type: "button", onclick: () => files.click() }, "Choose files"),
    ),
    files,
    folder,
  );
  let depth = 0;
  zone.addEventListener("dragenter", () => {
    depth += 1;
    zone.classList.add("over");
  });
  zone.addEventListener("dragleave", () => {
    depth -= 1;
    if (depth <= 0) zone.classList.remove("over");
  });
  zone.addEventListener("drop", async (event) => {
    event.preventDefault();
    depth = 0;
    zone.classList.remove("over");
    onfiles(await filesOf(event.dataTransfer));
  });
  return zone;
}
