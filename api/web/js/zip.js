// A ZIP, unpacked where it was dropped: a campaign that was downloaded need not be unpacked by hand.

const MOST_BYTES = 2e9;
const END = 0x06054b50;
const ENTRY = 0x02014b50;

class Unusable extends Error {}

/** The files in a ZIP; folders are left out, names keep their last part. */
export async function unzipped(file) {
  const tail = new DataView(await file.slice(Math.max(0, file.size - 65_557)).arrayBuffer());
  let end = tail.byteLength - 22;
  while (end >= 0 && tail.getUint32(end, true) !== END) end -= 1;
  if (end < 0) throw new Unusable(`${file.name} is not a ZIP, or was cut off on its way`);
  const [size, offset] = [tail.getUint32(end + 12, true), tail.getUint32(end + 16, true)];
  if (offset + size > file.size) throw new Unusable(`${file.name} is too large to be unpacked here; unpack it first`);
  const entries = listed(new DataView(await file.slice(offset, offset + size).arrayBuffer()));
  const total = entries.reduce((sum, entry) => sum + entry.size, 0);
  if (total > MOST_BYTES) throw new Unusable(`${file.name} holds ${(total / 1e9).toFixed(1)} GB; unpack it first`);
  const found = [];
  for (const entry of entries) found.push(await taken(file, entry));
  return found;
}

function listed(view) {
  const entries = [];
  const text = new TextDecoder();
  let at = 0;
  while (at + 46 <= view.byteLength && view.getUint32(at, true) === ENTRY) {
    const [names, extras, remarks] = [28, 30, 32].map((k) => view.getUint16(at + k, true));
    const name = text.decode(new Uint8Array(view.buffer, at + 46, names));
    const entry = {
      name,
      method: view.getUint16(at + 10, true),
      packed: view.getUint32(at + 20, true),
      size: view.getUint32(at + 24, true),
      at: view.getUint32(at + 42, true),
    };
    if (!name.endsWith("/")) entries.push(entry);
    at += 46 + names + extras + remarks;
  }
  return entries;
}

async function taken(file, entry) {
  const local = new DataView(await file.slice(entry.at, entry.at + 30).arrayBuffer());
  const start = entry.at + 30 + local.getUint16(26, true) + local.getUint16(28, true);
  const packed = file.slice(start, start + entry.packed);
  const name = entry.name.split("/").at(-1);
  if (entry.method === 0) return new File([packed], name);
  if (entry.method !== 8) throw new Unusable(`${file.name} is packed in a way that is not known here; unpack it first`);
  const parts = [];
  let bytes = 0;
  const reader = packed.stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    bytes += value.length;
    // what unpacks to more than it says is not what it says
    if (bytes > entry.size) throw new Unusable(`${file.name} holds more than it says`);
    parts.push(value);
  }
  return new File(parts, name);
}
