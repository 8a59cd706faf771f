// Uploads: three at once, each with its progress; what breaks is tried again, and what was sent of a large file is not sent twice.
import { at, keyHeaders, part, Problem, problemOf, send } from "./api.js";

const AT_ONCE = 3;
/** Files from this size on go in pieces, so that a broken line costs one piece. */
const LARGE = 8e6;
const PIECE = 4e6;
const TRIES = 5;
const TUS = { "Tus-Resumable": "1.0.0" };
const queues = new Map();

/** The files that a campaign names, of cuts, in the air and of hammer tests, each with `uploaded`. */
export const namedFiles = (campaign) =>
  [...campaign.cuts.flatMap((cut) => [cut.cut, cut.air]), ...campaign.hammer_tests.map((test) => test.file)].filter(Boolean);

/** The uploads of a campaign; they go on while other views are looked at. */
export function queueFor(id) {
  if (!queues.has(id)) queues.set(id, new Queue(id));
  return queues.get(id);
}

window.addEventListener("beforeunload", (event) => {
  if ([...queues.values()].some((queue) => queue.running)) event.preventDefault();
});

class Queue extends EventTarget {
  constructor(id) {
    super();
    this.id = id;
    this.items = new Map();
    this.active = 0;
    this.strangers = [];
  }

  get running() {
    return [...this.items.values()].some((item) => item.state === "waiting" || item.state === "sending");
  }

  /** Put files in the queue that the campaign names; others are kept aside in `strangers`. */
  add(campaign, files) {
    const names = new Set(namedFiles(campaign).map((file) => file.name));
    this.strangers = files.filter((file) => !names.has(file.name)).map((file) => file.name);
    const given = new Map(files.map((file) => [file.name, file]));
    // in the campaign's order: verdicts come from the top
    for (const file of [...names].map((name) => given.get(name)).filter(Boolean)) {
      if (this.items.get(file.name)?.state === "sending") continue;
      this.items.set(file.name, { name: file.name, file, state: "waiting", sent: 0, problem: null, replace: false });
    }
    this.changed();
    this.pump();
  }

  /** Once more, over what is there where `replace`. */
  retry(name, replace = false) {
    const item = this.items.get(name);
    Object.assign(item, { state: "waiting", sent: 0, problem: null, replace });
    this.changed();
    this.pump();
  }

  changed(item = null) {
    this.dispatchEvent(new CustomEvent("change", { detail: item }));
  }

  pump() {
    while (this.active < AT_ONCE) {
      const item = [...this.items.values()].find((each) => each.state === "waiting");
      if (!item) return;
      item.state = "sending";
      this.active += 1;
      this.send(item).finally(() => {
        this.active -= 1;
        this.changed(item);
        this.pump();
      });
    }
  }

  async send(item) {
    const campaign = `campaigns/${part(this.id)}`;
    const recording = `${campaign}/recordings/${part(item.name)}${item.replace ? "?replace=true" : ""}`;
    const progress = (bytes) => {
      item.sent = bytes;
      this.changed(item);
    };
    for (let turn = 1; ; turn += 1) {
      try {
        if (item.file.size > LARGE && !item.replace) await inPieces(`${campaign}/uploads`, item, progress);
        else await sent("PUT", recording, item.file, { "Content-Type": "application/octet-stream" }, progress);
        item.state = "done";
        return;
      } catch (error) {
        if (!(error instanceof Problem)) throw error;
        // nothing there, too much at once, on its way down, or at another offset meanwhile: all of this passes
        const passes = error.status === 0 || error.status === 429 || error.status >= 500 || error.headers?.has("upload-offset");
        if (!passes || turn >= TRIES) {
          Object.assign(item, { state: "failed", problem: error });
          return;
        }
        const told = Number(error.headers?.get("retry-after"));
        await new Promise((resolve) => setTimeout(resolve, told > 0 ? told * 1000 : 500 * 2 ** turn));
      }
    }
  }
}

/** Send a body and report its progress, which fetch cannot; returns the answer's `Upload-Offset`. */
function sent(method, path, body, headers, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open(method, at(path));
    for (const [name, value] of Object.entries({ ...keyHeaders(), ...headers })) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => progress(event.loaded);
    request.onload = () => {
      const answered = new Headers();
      for (const name of ["retry-after", "upload-offset"]) {
        const value = request.getResponseHeader(name);
        if (value !== null) answered.set(name, value);
      }
      if (request.status >= 200 && request.status < 300) resolve(Number(answered.get("upload-offset")));
      else reject(problemOf(request.status, request.responseText, answered));
    };
    request.onerror = () => reject(problemOf(0, ""));
    request.send(body);
  });
}

/** Send a file in pieces by tus, from where the service has it. */
async function inPieces(uploads, { name, file }, progress) {
  const path = `${uploads}/${part(name)}`;
  let offset = (await offsetOf(path, file.size)) ?? (await begun(uploads, name, file.size));
  while (offset < file.size) {
    const headers = { ...TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": String(offset) };
    offset = await sent("PATCH", path, file.slice(offset, offset + PIECE), headers, (bytes) => progress(offset + bytes));
  }
}

/** Where an unfinished upload of this length goes on; null where there is none, one of another length being given up. */
async function offsetOf(path, size) {
  try {
    const { headers } = await send("HEAD", path, { headers: TUS });
    const [offset, length] = ["upload-offset", "upload-length"].map((name) => Number(headers.get(name)));
    if (offset < length && length === size) return offset;
    if (offset < length) await send("DELETE", path, { headers: TUS });
  } catch (error) {
    if (error.status !== 404) throw error;
  }
  return null;
}

async function begun(uploads, name, size) {
  const metadata = `filename ${btoa(String.fromCharCode(...new TextEncoder().encode(name)))}`;
  const answer = await send("POST", uploads, { headers: { ...TUS, "Upload-Length": String(size), "Upload-Metadata": metadata } });
  return Number(answer.headers.get("upload-offset"));
}
