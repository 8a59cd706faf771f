// A ZIP, unpacked where it was dropped: a campaign that was downloaded need not be unpacked by hand.
import { zipjs } from "./charts.js";

const MOST_BYTES = 2e9;

/** The files in a ZIP, each compared with its checksum; folders are left out, names keep their last part. */
export async function unzipped(file) {
  const zip = await zipjs();
  // the page's rules allow no worker made from a text
  const reader = new zip.ZipReader(new zip.BlobReader(file), { checkSignature: true, checkOverlappingEntry: true, useWebWorkers: false });
  try {
    const entries = (await told(file, null, () => reader.getEntries())).filter((entry) => !entry.directory);
    const total = entries.reduce((sum, entry) => sum + entry.uncompressedSize, 0);
    if (total > MOST_BYTES) throw new Error(`${file.name} holds ${(total / 1e9).toFixed(1)} GB; unpack it first`);
    const found = [];
    for (const entry of entries) {
      const name = entry.filename.split("/").at(-1);
      found.push(new File([await told(file, name, () => entry.getData(new zip.BlobWriter()))], name));
    }
    return found;
  } finally {
    await reader.close();
  }
}

async function told(file, name, work) {
  try {
    return await work();
  } catch (error) {
    const what = name === null ? `${file.name} is not a ZIP, or was cut off on its way` : `${name} in ${file.name} is damaged, locked, or packed in a way that is not known here`;
    throw new Error(`${what} (${error.message}); unpack it first to see what is whole`);
  }
}
