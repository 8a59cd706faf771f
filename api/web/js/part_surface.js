// A surface of triangles as pixels: the nearest triangle of each pixel, lit from above left, in the colour that it is given. Without a library and
// without the graphics card: some ten thousand triangles take a few hundredths of a second, and look the same everywhere.

/** Cosine of the angle between neighbouring triangles from which on their edge is sharp. */
const SHARP = 0.8;
const LIGHT = [-0.35, 0.55, 0.76];
const STEEL = [176, 190, 204];

/** A surface made ready: `points_mm` and `triangles` as the service tells them. */
export function surfaceOf({ points_mm, triangles }) {
  const points = Float32Array.from(points_mm);
  const corners = Uint32Array.from(triangles);
  const count = corners.length / 3;
  const faces = new Float32Array(3 * count);
  const sums = new Float32Array(points.length);
  for (let t = 0; t < count; t += 1) {
    const [a, b, c] = [3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]];
    const [ux, uy, uz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [vx, vy, vz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = Math.hypot(...n) || 1;
    for (let k = 0; k < 3; k += 1) {
      faces[3 * t + k] = n[k] / size;
      // larger triangles count for more
      for (const p of [a, b, c]) sums[p + k] += n[k];
    }
  }
  // round where neighbours are nearly even, and not across edges
  const normals = new Float32Array(9 * count);
  for (let t = 0; t < count; t += 1) {
    for (let i = 0; i < 3; i += 1) {
      const p = 3 * corners[3 * t + i];
      const size = Math.hypot(sums[p], sums[p + 1], sums[p + 2]) || 1;
      const even = (sums[p] * faces[3 * t] + sums[p + 1] * faces[3 * t + 1] + sums[p + 2] * faces[3 * t + 2]) / size;
      for (let k = 0; k < 3; k += 1) normals[9 * t + 3 * i + k] = even > SHARP ? sums[p + k] / size : faces[3 * t + k];
    }
  }
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 1) {
    low[i % 3] = Math.min(low[i % 3], points[i]);
    high[i % 3] = Math.max(high[i % 3], points[i]);
  }
  return { points, corners, faces, normals, count, low, high };
}

/**
 * Pixels of a surface seen along `view` (rows: right, up, towards who looks): `flat(p)` brings a point to pixels, linear but for a shift.
 * `paint[t]` is the colour [r, g, b] of triangle t, or null for bare material.
 */
export function pixelsOf(surface, view, { scale, shift }, width, height, paint) {
  const { points, corners, faces, normals, count } = surface;
  const [right, up, near] = view;
  const light = [0, 1, 2].map((k) => right[k] * LIGHT[0] + up[k] * LIGHT[1] + near[k] * LIGHT[2]);
  const seen = new Float32Array(points.length);
  for (let p = 0; p < points.length; p += 3) {
    const [x, y, z] = [points[p], points[p + 1], points[p + 2]];
    seen[p] = shift[0] + scale * (right[0] * x + right[1] * y + right[2] * z);
    seen[p + 1] = shift[1] - scale * (up[0] * x + up[1] * y + up[2] * z);
    seen[p + 2] = scale * (near[0] * x + near[1] * y + near[2] * z);
  }
  const depth = new Float32Array(width * height).fill(-Infinity);
  const owner = new Int32Array(width * height).fill(-1);
  const image = new ImageData(width, height);
  const data = image.data;
  for (let t = 0; t < count; t += 1) {
    const [a, b, c] = [3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]];
    const [ax, ay, bx, by, cx, cy] = [seen[a], seen[a + 1], seen[b], seen[b + 1], seen[c], seen[c + 1]];
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    // counterclockwise from outside, and pixels count downwards
    if (area >= 0) continue;
    const [x0, x1] = [Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5)), Math.min(width - 1, Math.floor(Math.max(ax, bx, cx) + 0.5))];
    const [y0, y1] = [Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5)), Math.min(height - 1, Math.floor(Math.max(ay, by, cy) + 0.5))];
    const lit = [0, 3, 6].map((i) => normals[9 * t + i] * light[0] + normals[9 * t + i + 1] * light[1] + normals[9 * t + i + 2] * light[2]);
    const [r, g, blue] = paint(t) ?? STEEL;
    for (let y = y0; y <= y1; y += 1) {
      for (let x = x0; x <= x1; x += 1) {
        const u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area;
        const v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area;
        const w = 1 - u - v;
        // a hair's breadth beyond its edges, so that no gaps are left between neighbours
        if (u < -1e-4 || v < -1e-4 || w < -1e-4) continue;
        const z = u * seen[a + 2] + v * seen[b + 2] + w * seen[c + 2];
        const at = y * width + x;
        if (z <= depth[at]) continue;
        depth[at] = z;
        owner[at] = t;
        const bright = 0.42 + 0.62 * Math.max(0, u * lit[0] + v * lit[1] + w * lit[2]);
        data[4 * at] = r * bright;
        data[4 * at + 1] = g * bright;
        data[4 * at + 2] = blue * bright;
        data[4 * at + 3] = 255;
      }
    }
  }
  edges(data, depth, owner, faces, width, height);
  return image;
}

/** Draw a line where two sides meet, or where one stands behind the other. */
function edges(data, depth, owner, faces, width, height) {
  for (let y = 0; y < height - 1; y += 1) {
    for (let x = 0; x < width - 1; x += 1) {
      const at = y * width + x;
      const here = owner[at];
      for (const beside of [at + 1, at + width]) {
        const other = owner[beside];
        if (here === other) continue;
        const inside = here >= 0 && other >= 0;
        let cos = 1;
        if (inside) cos = faces[3 * here] * faces[3 * other] + faces[3 * here + 1] * faces[3 * other + 1] + faces[3 * here + 2] * faces[3 * other + 2];
        if (inside && cos > 0.75 && Math.abs(depth[at] - depth[beside]) < 8) continue;
        const dark = here >= 0 ? at : beside;
        for (let k = 0; k < 3; k += 1) data[4 * dark + k] *= 0.6;
        break;
      }
    }
  }
}
