// Drawings of toolings, as the service makes them. Shown as pictures: whatever an SVG may hold, a picture runs nothing.
import { send } from "./api.js";
import { h } from "./dom.js";

const DARK = "@media (prefers-color-scheme:dark)";

function forTheme(svg) {
  const chosen = document.documentElement.dataset.theme;
  if (!chosen) return svg;
  return svg.replace(DARK, chosen === "dark" ? "@media all" : "@media not all");
}

/** A picture that follows light and dark; `.show(svg)` puts a drawing in. */
export function picture(words) {
  const image = h("img", { class: "drawing", alt: words, hidden: true });
  let svg = null;
  let url = null;
  const draw = () => {
    if (!image.isConnected && url) {
      window.removeEventListener("theme", draw);
      URL.revokeObjectURL(url);
      return;
    }
    const next = URL.createObjectURL(new Blob([forTheme(svg)], { type: "image/svg+xml" }));
    image.src = next;
    image.hidden = false;
    if (url) URL.revokeObjectURL(url);
    url = next;
  };
  image.show = (text) => {
    const first = svg === null;
    svg = text;
    draw();
    if (first) window.addEventListener("theme", draw);
  };
  return image;
}

/** The drawing of a tooling of the library; a `brief` one reads where it is small. */
export function libraryDrawing(name, { brief = false } = {}) {
  const image = picture(`Drawing of ${name}, to scale`);
  send("GET", `toolings/${encodeURIComponent(name)}/drawing${brief ? "?brief=true" : ""}`)
    .then((answer) => answer.text())
    .then((text) => image.show(text))
    .catch(() => image.remove());
  return image;
}

/** The drawing of keys that are not saved; throws the `Problem` of what cannot be drawn. */
export async function drawn(keys, signal) {
  return (await send("POST", "toolings/drawing", { json: keys, signal })).text();
}
