// The service: one way in, with the key, and with problem documents as errors.

const KEY = "rcsa.key";
let key = "";
try {
  key = sessionStorage.getItem(KEY) ?? "";
} catch {
  // it is asked for again then
}

export const hasKey = () => key !== "";
export const keyOf = () => key;

export function setKey(next) {
  key = next.trim();
  try {
    if (key) sessionStorage.setItem(KEY, key);
    else sessionStorage.removeItem(KEY);
  } catch {
    // kept for this page only
  }
}

/** An answer other than the one asked for: `errors` name fields as {field, found, allowed}. */
export class Problem extends Error {
  constructor(status, document, headers = null) {
    super(document.detail || "something went wrong");
    this.status = status;
    this.errors = document.errors ?? [];
    this.request = document.request_id ?? "";
    this.headers = headers;
  }
}

export const at = (path) => new URL(`v1/${path}`, document.baseURI).href;
/** A part of a path that may hold anything. */
export const part = (text) => encodeURIComponent(text);
export const keyHeaders = () => (key ? { "X-API-Key": key } : {});

/** A key under which the same request may be sent twice; also where the connection is not an encrypted one. */
export function once() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return { "Idempotency-Key": [...bytes].map((b) => b.toString(16).padStart(2, "0")).join("") };
}

/** The problem of an answer that is none; `used` is the key that it was asked for with. */
export function problemOf(status, text, headers = null, used = key) {
  let found = null;
  try {
    found = JSON.parse(text);
  } catch {
    // not from the service: a proxy, or nothing at all
  }
  // a refusal that comes late, of a key that was replaced meanwhile, says nothing of the one in use
  if (status === 401 && used === key) window.dispatchEvent(new Event("key-wanted"));
  if (found && typeof found === "object" && found.detail) return new Problem(status, found, headers);
  return new Problem(
    status,
    { detail: status ? `the service answered ${status}` : "the service does not answer; is it running, and is the network there?" },
    headers,
  );
}

/** fetch; what may be repeated is sent a second time where the line broke. */
async function fetched(address, sent) {
  try {
    return await fetch(address, sent);
  } catch (error) {
    const twice = sent.method === "GET" || "Idempotency-Key" in sent.headers;
    if (!twice || error.name === "AbortError") throw error;
    await new Promise((resolve) => setTimeout(resolve, 400));
    return fetch(address, sent);
  }
}

/** Send, and return the answer; everything but 2xx and 304 is thrown as a `Problem`. */
export async function send(method, path, { json, body, headers = {}, signal, keepalive = false } = {}) {
  const used = key;
  const sent = { method, signal, keepalive, headers: { ...keyHeaders(), ...headers } };
  if (json !== undefined) {
    sent.body = JSON.stringify(json);
    sent.headers["Content-Type"] = "application/json";
  } else if (body !== undefined) sent.body = body;
  let answer;
  try {
    answer = await fetched(at(path), sent);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw problemOf(0, "");
  }
  if (!answer.ok && answer.status !== 304) throw problemOf(answer.status, await answer.text(), answer.headers, used);
  return answer;
}

export const get = async (path, options) => (await send("GET", path, options)).json();
export const post = async (path, json, options = {}) => (await send("POST", path, { json, ...options })).json();
export const getText = async (path, accept, options = {}) => (await send("GET", path, { headers: { Accept: accept }, ...options })).text();
export const getBlob = async (path) => (await send("GET", path)).blob();

/** How far a service is that has just been started, in words. */
export async function howFar() {
  const answer = await fetched(new URL("ready", document.baseURI).href, { method: "GET", headers: {} });
  return answer.ok ? "The virtual machine gets ready …" : `Wait: ${problemOf(answer.status, await answer.text()).message} …`;
}

let description = null;

/** The description of the interface, asked for once. */
export function described() {
  description ??= fetched(new URL("openapi.json", document.baseURI).href, { method: "GET", headers: {} })
    .then((answer) => answer.json())
    .catch(() => {
      description = null;
      throw problemOf(0, "");
    });
  return description;
}

/** All items of a list that comes in parts. */
export async function all(path) {
  const found = [];
  let after = "";
  do {
    const joint = path.includes("?") ? "&" : "?";
    const page = await get(`${path}${joint}limit=200${after ? `&after=${part(after)}` : ""}`);
    found.push(...page.items);
    after = page.next;
  } while (after);
  return found;
}

/**
 * Follow a stream of server-sent events until its end; a connection that breaks is taken up again where it broke.
 * `on(event, data)` gets each; return true from it to stop. Keys travel in a header, which EventSource cannot send.
 */
export async function follow(path, on, signal) {
  let last = null;
  let wait = 500;
  for (;;) {
    try {
      const headers = { Accept: "text/event-stream", ...(last === null ? {} : { "Last-Event-ID": last }) };
      const answer = await send("GET", path, { headers, signal });
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        // a line ends by CR, LF or both; a CR at the end of a part may be half of both
        const blocks = (rest + value).replace(/\r\n|\r(?!$)/g, "\n").split("\n\n");
        rest = blocks.pop();
        for (const block of blocks) {
          const event = parsed(block);
          if (event.id !== null) last = event.id;
          wait = 500;
          if (event.data !== null && on(event.name, JSON.parse(event.data)) === true) return;
        }
      }
    } catch (error) {
      if (error.name === "AbortError" || signal?.aborted) return;
      if (error instanceof Problem && error.status >= 400 && error.status < 500 && error.status !== 429) throw error;
    }
    if (signal?.aborted) return;
    await new Promise((resolve) => setTimeout(resolve, wait));
    wait = Math.min(wait * 2, 8000);
  }
}

function parsed(block) {
  const event = { name: "message", id: null, data: null };
  for (const line of block.split("\n")) {
    const [, name, value] = /^([a-z]+): ?(.*)$/.exec(line) ?? [];
    if (name === "event") event.name = value;
    else if (name === "id") event.id = value;
    else if (name === "data") event.data = event.data === null ? value : `${event.data}\n${value}`;
  }
  return event;
}
