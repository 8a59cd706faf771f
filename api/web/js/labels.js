// Labels in a chart that do not cover each other: the more important ones first, each a step higher where its place is taken.

/** Width of a figure and height of a line, as shares of the letters' size [px]; lines that a label may climb. */
const [WIDE, HIGH, CLIMBS] = [0.65, 1.45, 4];

/**
 * The labels that find a place, each with its `shift` upwards [px] from its point; the first one always finds one.
 * A label has x, y and size [px] (y grows upwards) and its text.
 */
export function apart(labels, first) {
  const taken = [];
  return labels.flatMap((label) => {
    const half = (WIDE * label.size * label.text.length) / 2;
    const line = HIGH * label.size;
    for (let climb = 0; climb < CLIMBS; climb += 1) {
      const low = label.y + first - line / 2 + climb * line;
      const box = { left: label.x - half, right: label.x + half, low, high: low + line };
      if (taken.some((other) => box.left < other.right && other.left < box.right && box.low < other.high && other.low < box.high)) continue;
      taken.push(box);
      return [{ ...label, shift: first + climb * line }];
    }
    return [];
  });
}
