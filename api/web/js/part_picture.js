// A part that was cut, with the path over it and the tool at a place of it: turned by dragging or with the arrow keys, as arms are.
import { eyes, roundLength, VIEWS } from "./arm_picture.js";
import { colour } from "./charts.js";
import { h } from "./dom.js";
import { pixelsOf, surfaceOf } from "./part_surface.js";
import { factor, plain, text, unit } from "./units.js";

/** Pixels of the picture, at most: a fine screen gets larger ones. */
const MOST_PIXELS = 900_000;
const MARGIN = 34;
/** What is drawn of the tool, and what of it has room above the part, in diameters. */
const [LONG, ABOVE] = [2, 1];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a, b, times = 1) => a.map((v, k) => v + times * b[k]);

/**
 * The picture: `element`, and `show({part, path, outline, paint, at})`, all of which is kept until it is given again.
 * `paint(t)` is a triangle's colour [r, g, b], null for bare material; `at` is {place, axis} of the tool.
 */
export function partPicture() {
  const canvas = h("canvas", { class: "part", tabindex: "0", role: "img", "aria-label": "The part" });
  let [, azimuth, elevation] = VIEWS[0];
  let shown = { part: null, path: { places_mm: [], rapid: [] }, outline: [], paint: () => null, at: null };
  let surface = null;
  let pixels = null;
  let waits = false;

  const element = h(
    "div",
    { class: "arm-picture" },
    canvas,
    h(
      "div",
      { class: "row-of-buttons", role: "group", "aria-label": "Seen" },
      VIEWS.map(([words, a, e]) => h("button", { type: "button", class: "quiet small", onclick: () => look(a, e) }, words)),
    ),
  );
  function look(a, e) {
    [azimuth, elevation] = [((a + 540) % 360) - 180, Math.max(-90, Math.min(90, e))];
    redraw(true);
  }
  function redraw(anew) {
    if (anew) pixels = null;
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      if (canvas.isConnected && canvas.clientWidth) draw();
    });
  }
  for (const name of ["units", "theme", "resize"]) {
    window.addEventListener(name, function again() {
      if (element.isConnected) redraw(name === "resize");
      else window.removeEventListener(name, again);
    });
  }

  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = { x: event.clientX, y: event.clientY, azimuth, elevation };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (held) look(held.azimuth - 0.5 * (event.clientX - held.x), held.elevation + 0.4 * (event.clientY - held.y));
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (held = null));
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [10, 0], ArrowRight: [-10, 0], ArrowUp: [0, 6], ArrowDown: [0, -6] }[event.key];
    if (!step) return;
    event.preventDefault();
    look(azimuth + step[0], elevation + step[1]);
  });

  function draw() {
    const [wide, tall] = [canvas.clientWidth, canvas.clientHeight];
    const fine = Math.min(window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (wide * tall)));
    const [width, height] = [Math.round(wide * fine), Math.round(tall * fine)];
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
      pixels = null;
    }
    const view = eyes(azimuth, elevation);
    const fit = fitted(view, width, height, fine);
    const flat = (p) => [fit.shift[0] + fit.scale * dot(view[0], p), fit.shift[1] - fit.scale * dot(view[1], p)];
    const pen = canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    if (surface) {
      pixels ??= pixelsOf(surface, view, fit, width, height, shown.paint);
      pen.putImageData(pixels, 0, 0);
    }
    pen.lineJoin = pen.lineCap = "round";
    route(pen, flat, fine);
    if (shown.at) tool(pen, flat, view, fit.scale, fine);
    corner(pen, view, width, height, fine, fit.scale);
    const size = surface ? surface.high.map((v, k) => text("length", v - surface.low[k], { digits: 1 })).join(" by ") : "nothing is left";
    const tip = shown.at ? ` The tool's tip is at ${shown.at.place.map((v) => text("length", v, { digits: 2 })).join(", ")}.` : "";
    canvas.setAttribute("aria-label", `The part, ${size}.${tip} Arrow keys turn the view.`);
    canvas.dataset.view = `${Math.round(azimuth)} ${Math.round(elevation)}`;
  }

  /** As large as the part lets it be, as it is seen now, with some room for the tool above it. */
  function fitted(view, width, height, fine) {
    const around = [];
    const box = surface ?? { low: lowOf(shown.path.places_mm), high: highOf(shown.path.places_mm) };
    for (let k = 0; k < 8; k += 1) around.push([0, 1, 2].map((i) => ((k >> i) & 1 ? box.high[i] : box.low[i])));
    const above = ABOVE * 2 * Math.max(0, ...shown.outline.map(([radius]) => radius));
    around.push(...around.filter((p) => p[2] === box.high[2]).map(([x, y, z]) => [x, y, z + above]));
    const xs = around.map((p) => dot(view[0], p));
    const ys = around.map((p) => -dot(view[1], p));
    const [left, top, far, low] = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
    const free = MARGIN * fine;
    const scale = Math.min((width - 2 * free) / (far - left || 1), (height - 2.6 * free) / (low - top || 1));
    return { scale, shift: [0.5 * width - (0.5 * scale) * (left + far), 0.5 * height - 0.1 * free - (0.5 * scale) * (top + low)] };
  }

  function route(pen, flat, fine) {
    const { places_mm: places, rapid } = shown.path;
    const at = places.map(flat);
    for (const fast of [true, false]) {
      pen.beginPath();
      for (let k = 1; k < at.length; k += 1) {
        if (rapid[k] !== fast) continue;
        if (k === 1 || rapid[k - 1] !== fast) pen.moveTo(...at[k - 1]);
        pen.lineTo(...at[k]);
      }
      pen.setLineDash(fast ? [4 * fine, 4 * fine] : []);
      pen.lineWidth = (fast ? 1 : 1.4) * fine;
      pen.strokeStyle = fast ? colour("soft", 0.55) : colour("ink", 0.75);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  /** The tool as rings about its axis, from the tip up. */
  function tool(pen, flat, view, scale, fine) {
    const { place, axis } = shown.at;
    const rise = [dot(view[0], axis), -dot(view[1], axis)];
    const length = Math.hypot(...rise);
    const turn = length > 1e-6 ? Math.atan2(rise[1], rise[0]) + Math.PI / 2 : 0;
    const flatter = Math.abs(dot(view[2], axis));
    const rings = shown.outline.map(([radius, height]) => ({ at: flat(plus(place, axis, height)), radius: Math.max(radius * scale, 0.01) }));
    const aside = [Math.cos(turn), Math.sin(turn)];
    pen.beginPath();
    for (const { at, radius } of [rings[0], rings.at(-1)]) {
      pen.moveTo(at[0] + radius * aside[0], at[1] + radius * aside[1]);
      // the way round that the sides go, too: all of it is filled once
      pen.ellipse(at[0], at[1], radius, radius * flatter, turn, 0, 2 * Math.PI, true);
    }
    const side = (way) => rings.map(({ at, radius }) => [at[0] + way * radius * aside[0], at[1] + way * radius * aside[1]]);
    [...side(1), ...side(-1).reverse()].forEach((p, k) => (k ? pen.lineTo(...p) : pen.moveTo(...p)));
    pen.closePath();
    pen.fillStyle = colour("accent", 0.28);
    pen.fill("nonzero");
    pen.lineWidth = 1.2 * fine;
    pen.strokeStyle = colour("accent", 0.9);
    pen.beginPath();
    for (const way of [1, -1]) side(way).forEach((p, k) => (k ? pen.lineTo(...p) : pen.moveTo(...p)));
    const top = rings.at(-1);
    pen.moveTo(top.at[0] + top.radius * aside[0], top.at[1] + top.radius * aside[1]);
    pen.ellipse(top.at[0], top.at[1], top.radius, top.radius * flatter, turn, 0, 2 * Math.PI);
    pen.stroke();
    pen.beginPath();
    pen.arc(...rings[0].at, 3.2 * fine, 0, 2 * Math.PI);
    pen.fillStyle = colour("accent");
    pen.fill();
  }

  /** Axes and a scale. */
  function corner(pen, view, width, height, fine, scale) {
    pen.font = `${13 * fine}px ${getComputedStyle(canvas).fontFamily}`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const origin = [34 * fine, height - 34 * fine];
    for (const [k, name, ink] of [[0, "x", "bad"], [1, "y", "good"], [2, "z", "s1"]]) {
      const way = [view[0][k] * 26 * fine, -view[1][k] * 26 * fine];
      if (Math.hypot(...way) < 6 * fine) continue;
      pen.strokeStyle = pen.fillStyle = colour(ink);
      pen.lineWidth = 2 * fine;
      pen.beginPath();
      pen.moveTo(...origin);
      pen.lineTo(origin[0] + way[0], origin[1] + way[1]);
      pen.stroke();
      pen.fillText(name, origin[0] + 1.35 * way[0], origin[1] + 1.35 * way[1]);
    }
    const long = roundLength(((0.25 * width) / scale) * factor("length"));
    const bar = (long / factor("length")) * scale;
    const [x, y] = [width - bar - 14 * fine, height - 14 * fine];
    pen.strokeStyle = pen.fillStyle = colour("ink");
    pen.lineWidth = 1.5 * fine;
    pen.beginPath();
    pen.moveTo(x, y - 5 * fine);
    pen.lineTo(x, y);
    pen.lineTo(x + bar, y);
    pen.lineTo(x + bar, y - 5 * fine);
    pen.stroke();
    pen.fillText(`${plain(long, 4)} ${unit("length")}`, x + 0.5 * bar, y - 12 * fine);
  }

  return {
    element,
    look,
    show: (next) => {
      if (next.part !== undefined && next.part !== shown.part) surface = next.part ? surfaceOf(next.part) : null;
      if (next.outline) next = { ...next, outline: shortened(next.outline) };
      shown = { ...shown, ...next };
      redraw("part" in next || "paint" in next);
    },
  };
}

/** The lower end of a tool's outline, [radius, height] from the tip up. */
function shortened(outline) {
  const end = LONG * 2 * Math.max(...outline.map(([radius]) => radius));
  const kept = outline.filter(([, height]) => height < end);
  return kept.length < outline.length ? [...kept, [kept.at(-1)[0], end]] : outline;
}

const lowOf = (places) => [0, 1, 2].map((k) => Math.min(0, ...places.map((p) => p[k])));
const highOf = (places) => [0, 1, 2].map((k) => Math.max(0, ...places.map((p) => p[k])));
