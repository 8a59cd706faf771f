// An arm in space, drawn as SVG without perspective: turned by dragging or with the arrow keys. Parts come from the service, each in the axes of what
// moves it; where these stand at some angles is worked out here, so that a slider moves the arm at once.
import { fill, h, s } from "./dom.js";
import { factor, plain, text, unit } from "./units.js";

const RAD = Math.PI / 180;
const EYE = { carrier: 0, turn: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], offset: [0, 0, 0] };
/** Where one stands who looks: azimuth from the base's x and elevation, in degrees. */
export const VIEWS = [
  ["At an angle", -58, 22],
  ["From the side", -90, 0],
  ["From above", -90, 90],
];

const times = (m, v) => m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
const product = (a, b) => a.map((row) => [0, 1, 2].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]));
const plus = (a, b) => a.map((v, k) => v + b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, f) => a.map((v) => v * f);
const unitOf = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

/** The matrix that turns about an axis. */
function about([x, y, z], degrees) {
  const [c, n] = [Math.cos(degrees * RAD), Math.sin(degrees * RAD)];
  const d = 1 - c;
  return [
    [c + x * x * d, x * y * d - z * n, x * z * d + y * n],
    [y * x * d + z * n, c + y * y * d, y * z * d - x * n],
    [z * x * d - y * n, z * y * d + x * n, c + z * z * d],
  ];
}

/** Frames of base and joints at some angles [°]. */
export function framesOf(joints, angles) {
  const frames = [EYE];
  joints.forEach((joint, k) => {
    const before = frames[k];
    const turn = product(before.turn, product(joint.turn, about(joint.axis, angles[k])));
    frames.push({ turn, offset: plus(before.offset, times(before.turn, joint.offset_mm)) });
  });
  return frames;
}

/** Directions to the right, up and towards who looks, as rows. */
export function eyes(azimuth, elevation) {
  const [a, e] = [azimuth * RAD, elevation * RAD];
  const right = [-Math.sin(a), Math.cos(a), 0];
  const near = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  return [right, cross(near, right), near];
}

/** The convex outline of points. */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const chain = (row) => {
    const kept = [];
    for (const p of row) {
      while (kept.length > 1) {
        const [o, a] = kept.slice(-2);
        if ((a[0] - o[0]) * (p[1] - o[1]) > (a[1] - o[1]) * (p[0] - o[0])) break;
        kept.pop();
      }
      kept.push(p);
    }
    return kept.slice(0, -1);
  };
  return [...chain(sorted), ...chain(sorted.toReversed())];
}

const round = (v) => Math.round(v * 100) / 100;
const listed = (points) => points.map((p) => `${round(p[0])},${round(p[1])}`).join(" ");
/** 1, 2 or 5 times a power of ten, at most so large. */
export function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((step) => step * power <= most * (1 + 1e-9));
}

/**
 * The picture: `element`, and `show({drawing, angles, path, chosen})`, all of which is kept until it is given again; `look(azimuth, elevation)`.
 * `path` are places [mm] in the base's axes, `chosen` the joint that is being moved.
 */
export function armPicture() {
  const svg = s("svg", { class: "arm", tabindex: "0", role: "img", "aria-label": "The arm" });
  let [, azimuth, elevation] = VIEWS[0];
  let shown = { drawing: null, angles: [], path: [], chosen: null };
  let box = null;
  let waits = false;

  const element = h(
    "div",
    { class: "arm-picture" },
    svg,
    h(
      "div",
      { class: "row-of-buttons", role: "group", "aria-label": "Seen" },
      VIEWS.map(([words, a, e]) => h("button", { type: "button", class: "quiet small", onclick: () => look(a, e) }, words)),
    ),
  );
  function look(a, e) {
    [azimuth, elevation] = [((a + 540) % 360) - 180, Math.max(-20, Math.min(90, e))];
    redraw();
  }
  function redraw() {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      if (shown.drawing) draw();
    });
  }

  window.addEventListener("units", function again() {
    if (svg.isConnected) redraw();
    else window.removeEventListener("units", again);
  });

  let held = null;
  svg.addEventListener("pointerdown", (event) => {
    held = { x: event.clientX, y: event.clientY, azimuth, elevation };
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    if (held) look(held.azimuth - 0.5 * (event.clientX - held.x), held.elevation + 0.4 * (event.clientY - held.y));
  });
  for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => (held = null));
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [10, 0], ArrowRight: [-10, 0], ArrowUp: [0, 6], ArrowDown: [0, -6] }[event.key];
    if (!step) return;
    event.preventDefault();
    look(azimuth + step[0], elevation + step[1]);
  });

  function draw() {
    const { drawing, angles, path, chosen } = shown;
    const frames = framesOf(drawing.joints, angles);
    const view = eyes(azimuth, elevation);
    const seen = (p) => times(view, p);
    const flat = (p) => [dot(view[0], p), -dot(view[1], p)];
    const inBase = (carrier, p) => plus(frames[carrier].offset, times(frames[carrier].turn, p));
    const reach = drawing.reach_mm;
    const parts = drawing.parts.map((p) => ({ ...p, points: p.points_mm.map((each) => inBase(p.carrier, each)) }));
    const tip = inBase(drawing.joints.length, drawing.tip_mm);
    const around = [...parts.flatMap((p) => p.points.map(flat).map((at) => [at, p.radius_mm])), ...path.map((p) => [flat(p), 20]), [flat(tip), 0]];
    const plate = 0.12 * reach;
    const corners = [[-plate, -plate], [plate, -plate], [plate, plate], [-plate, plate]];
    for (const [x, y] of corners) around.push([flat([x, y, 0]), 0.08 * reach]);
    box = fitted(box, around);
    // as large as the page's own, however large the picture is
    const letters = 13 / (Math.min(svg.clientWidth / box.width, svg.clientHeight / box.height) || 1);
    const children = [];
    const line = (kind, points, width, more = {}) =>
      s("polyline", { class: kind, points: listed(points), "stroke-width": round(width), "stroke-linecap": "round", "stroke-linejoin": "round", ...more });
    const area = (kind, points, width) => s("polygon", { class: kind, points: listed(points), "stroke-width": round(width) });
    const words = (said, [x, y], kind = "", anchor = "middle") =>
      s("text", { class: kind, x: round(x), y: round(y), "font-size": round(letters), "text-anchor": anchor, "stroke-width": round(0.2 * letters) }, said);

    // the ground with its grid, the arm's shadow, the base plate
    const floor = -0.018 * reach;
    const step = roundLength(0.25 * reach);
    const most = Math.ceil((0.75 * reach) / step) * step;
    const ground = [[-most, -most], [most, -most], [most, most], [-most, most]].map(([x, y]) => flat([x, y, floor]));
    const thin = 0.06 * letters;
    children.push(area("ground", ground, thin));
    for (let v = -most; v <= most + 1e-6; v += step)
      for (const pair of [[[v, -most, floor], [v, most, floor]], [[-most, v, floor], [most, v, floor]]]) children.push(line("grid", pair.map(flat), thin));
    if (view[2][2] > 0.05)
      children.push(s("g", { class: "shadow" }, parts.map((p) => line("dark", p.points.map(([x, y]) => flat([x, y, floor])), 1.7 * p.radius_mm))));
    const block = corners.flatMap(([x, y]) => [flat([x, y, floor]), flat([x, y, 0])]);
    children.push(area("plate", hull(block), thin), area("plate", corners.map(([x, y]) => flat([x, y, 0])), thin));

    if (path.length) {
      children.push(line("path", path.map(flat), 0.28 * letters));
      for (const end of [path[0], path.at(-1)]) children.push(s("circle", { class: "end", cx: round(flat(end)[0]), cy: round(flat(end)[1]), r: round(0.3 * letters) }));
    }

    // from the farthest to the nearest part; seen from its side a joint hides the ends of both of its links
    for (const p of parts) p.near = p.points.reduce((sum, each) => sum + seen(each)[2], 0) / p.points.length;
    for (const p of parts) {
      p.axis = unitOf(plus(p.points.at(-1), scaled(p.points[0], -1)));
      if (p.kind !== "joint" || Math.abs(dot(p.axis, view[2])) >= 0.5) continue;
      for (const limb of parts)
        if (limb.kind === "limb" && [0, 1].includes(p.carrier - limb.carrier)) p.near = Math.max(p.near, limb.near + 1e-6);
    }
    for (const p of parts.toSorted((a, b) => a.near - b.near)) {
      const width = 2 * p.radius_mm;
      if (p.kind === "limb" || p.kind === "spindle") {
        const points = p.points.map(flat);
        const rim = 0.14 * letters;
        const light = points.map(([x, y]) => [x - 0.17 * width, y - 0.17 * width]);
        children.push(line("rim", points, width + rim), line(p.kind, points, width - rim), line(`${p.kind} lit`, light, 0.22 * width));
      } else {
        const kind = `${p.kind}${p.kind === "joint" && p.carrier - 1 === chosen ? " chosen" : ""}`;
        const aside = Math.abs(dot(p.axis, view[2])) > 1 - 1e-9 ? view[0] : unitOf(cross(p.axis, view[2]));
        const other = cross(p.axis, aside);
        const ring = (end) =>
          Array.from({ length: 28 }, (_, k) => (k * Math.PI) / 14).map((t) =>
            flat(plus(end, plus(scaled(aside, p.radius_mm * Math.cos(t)), scaled(other, p.radius_mm * Math.sin(t))))),
          );
        const rings = [ring(p.points[0]), ring(p.points.at(-1))];
        children.push(area(kind, hull(rings.flat()), thin));
        if (Math.abs(dot(p.axis, view[2])) > 0.02) children.push(area(`${kind} cap`, rings[dot(p.axis, view[2]) > 0 ? 1 : 0], thin));
      }
    }

    // axes and names, none of which covers another
    const taken = [];
    drawing.joints.forEach((joint, k) => {
      const part = parts.find((p) => p.kind === "joint" && p.carrier === k + 1);
      const axis = times(frames[k + 1].turn, joint.axis);
      const half = scaled(axis, 2 * part.radius_mm);
      const [start, end] = [flat(plus(frames[k + 1].offset, scaled(half, -1))), flat(plus(frames[k + 1].offset, half))];
      children.push(line("axis", [start, end], 0.08 * letters, { "stroke-dasharray": `${round(letters)} ${round(0.3 * letters)} ${round(0.2 * letters)} ${round(0.3 * letters)}` }));
      const gap = Math.hypot(end[0] - start[0], end[1] - start[1]);
      const beyond = gap > 1e-6 ? [((end[0] - start[0]) / gap) * letters, ((end[1] - start[1]) / gap) * letters] : [1.2 * letters, -letters];
      const place = [end[0] + beyond[0], end[1] + beyond[1] + 0.35 * letters];
      while (taken.some(([x, y]) => Math.abs(x - place[0]) < 1.6 * letters && Math.abs(y - place[1]) < 1.1 * letters)) place[1] -= 1.1 * letters;
      taken.push(place);
      children.push(words(joint.name, place, k === chosen ? "name chosen" : "name"));
    });

    // the base's axes and a scale, in the corner
    const corner = [box.x + 2.6 * letters, box.y + box.height - 3.4 * letters];
    ["x", "y", "z"].forEach((name, k) => {
      const way = flat([0, 1, 2].map((i) => (i === k ? 2.2 * letters : 0)));
      if (Math.hypot(...way) < 0.5 * letters) return;
      const end = [corner[0] + way[0], corner[1] + way[1]];
      children.push(line(`world ${name}`, [corner, end], 0.14 * letters), words(name, [end[0] + 0.35 * way[0], end[1] + 0.35 * way[1] + 0.35 * letters], `world ${name}`));
    });
    const shownLength = roundLength(0.25 * box.width * factor("length"));
    const length = shownLength / factor("length");
    const [x, y] = [box.x + box.width - length - letters, box.y + box.height - 0.8 * letters];
    children.push(line("bar", [[x, y - 0.4 * letters], [x, y], [x + length, y], [x + length, y - 0.4 * letters]], 0.12 * letters));
    children.push(words(`${plain(shownLength)} ${unit("length")}`, [x + 0.5 * length, y - 0.6 * letters], "soft"));
    svg.setAttribute("viewBox", [box.x, box.y, box.width, box.height].map(round).join(" "));
    svg.setAttribute("aria-label", `The arm; the tool's tip is at ${tip.map((v) => text("length", v, { digits: 0 })).join(", ")}. Arrow keys turn the view.`);
    svg.dataset.tip = tip.map(round).join(" ");
    svg.dataset.view = `${round(azimuth)} ${round(elevation)}`;
    fill(svg, children);
  }

  return {
    element,
    look,
    show: (next) => {
      if (next.drawing && next.drawing !== shown.drawing) box = null;
      shown = { ...shown, ...next };
      redraw();
    },
  };
}

/** What is looked at: it stays where it is while the arm fits in and fills half of it. */
function fitted(box, around) {
  const low = [0, 1].map((k) => Math.min(...around.map(([p, r]) => p[k] - r)));
  const high = [0, 1].map((k) => Math.max(...around.map(([p, r]) => p[k] + r)));
  const [wide, tall] = [high[0] - low[0], high[1] - low[1]];
  const inside = box && low[0] >= box.x && low[1] >= box.y && high[0] <= box.x + box.width && high[1] <= box.y + box.height;
  if (inside && Math.max(wide / box.width, tall / box.height) > 0.55) return box;
  // as wide as a picture is, with room for axes and scale below
  const height = Math.max(1.25 * tall, (1.2 * wide) / 1.35);
  const width = 1.35 * height;
  return { x: (low[0] + high[0] - width) / 2, y: (low[1] + high[1] - height) / 2 + 0.05 * height, width, height };
}
