// Uploads: three at once, each with its progress; what breaks is tried again, and what was sent of a large file is not sent twice.
import { at, keyHeaders, part, Problem, problemOf, send } from "./api.js";

const AT_ONCE = 3;
/** Files from this size on go in pieces, so that a broken line costs one piece. */
const LARGE = 8e6;
const PIECE = 4e6;
const TRIES = 5;
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
      this.items.set(file.name, { name: file.name, file, state: "waiting", sent: 0, problem: null, recording: null, replace: false });
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
    const path = `campaigns/${part(this.id)}/recordings/${part(item.name)}${item.replace ? "?replace=true" : ""}`;
    const progress = (sent) => {
      item.sent = sent;
      this.changed(item);
    };
    for (let turn = 1; ; turn += 1) {
      try {
        item.recording =
          item.file.size > LARGE && !item.replace
            ? await inPieces(path, item.file, progress)
            : await whole("PUT", path, item.file, {}, progress);
        item.state = "done";
        return;
      } catch (error) {
        if (!(error instanceof Problem)) throw error;
        // nothing there, too much at once, or on its way down: all of this passes
        const passes = error.status === 0 || error.status === 429 || error.status >= 500;
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

/** Send a body with its progress, which fetch does not tell; returns the answer's JSON, or the headers of an empty one. */
function whole(method, path, body, headers, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open(method, at(path));
    for (const [name, value] of Object.entries({ "Content-Type": "application/octet-stream", ...keyHeaders(), ...headers }))
      request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => progress(event.loaded);
    const told = new Headers();
    request.onload = () => {
      for (const name of ["retry-after", "upload-offset"]) {
        const value = request.getResponseHeader(name);
        if (value !== null) told.set(name, value);
      }
      if (request.status >= 200 && request.status < 300) resolve(request.status === 204 ? told : JSON.parse(request.responseText));
      else reject(problemOf(request.status, request.responseText, told));
    };
    request.onerror = () => reject(problemOf(0, ""));
    request.send(body);
  });
}

/** Send a file in pieces, from where the service says that it has it. */
async function inPieces(path, file, progress) {
  let offset = await offsetOf(path, file.size);
  for (;;) {
    const piece = file.slice(offset, offset + PIECE);
    const headers = { "Upload-Offset": String(offset), "Upload-Length": String(file.size) };
    try {
      const answer = await whole("PATCH", path, piece, headers, (sent) => progress(offset + sent));
      if (!(answer instanceof Headers)) return answer;
      offset = Number(answer.get("upload-offset"));
    } catch (error) {
      const right = error.headers?.get("upload-offset");
      // another content under this name is a problem; another offset is not
      if (error.status !== 409 || right === null || right === undefined || Number(right) === offset) throw error;
      offset = Number(right);
    }
  }
}

async function offsetOf(path, size) {
  try {
    const answer = await send("HEAD", path);
    const length = Number(answer.headers.get("upload-length"));
    const offset = Number(answer.headers.get("upload-offset"));
    return length === size && offset < size ? offset : 0;
  } catch (error) {
    if (error.status === 404) return 0;
    throw error;
  }
}
