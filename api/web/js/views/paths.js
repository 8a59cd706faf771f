// A tool along a path through stock: a program and its stock dropped, cut as a job on a machine or a robot, and the part looked at.
import { all, follow, get, Problem, send } from "../api.js";
import { add, fill, h, head, link, note, waiting } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, clearFaults, failed } from "../forms.js";
import { RUNNING, secondsIn, shareOf, wordsOf } from "../jobs.js";
import { remember, to } from "../router.js";
import { pathAnswer } from "./path_answer.js";
import { pathForm } from "./path_form.js";
import { PUBLISHED } from "./robot_form.js";

export async function view(_args, query, place) {
  const [machines, kept, toolings, { items: materials }] = await Promise.all([all("machines"), all("robots"), all("toolings"), get("materials")]);
  const known = machines.filter((each) => each.identification && each.identification.status !== "failed");
  const robots = [
    ...kept.map((each) => ({ name: each.name, words: each.label })),
    ...Object.keys(PUBLISHED).filter((name) => !kept.some((each) => each.name === name)).map((name) => ({ name, words: name })),
  ];
  if (!toolings.length) {
    add(
      place,
      head("Paths", "What a tool does along a program: the part that is left, chatter, forces and form errors, move by move."),
      note("", h("p", null, "No tooling yet: a path is that of a tool's tip. ", link(to("toolings"), "To the toolings"))),
    );
    return;
  }
  const form = pathForm({ machines: known, robots, postures: PUBLISHED, toolings, materials, query });
  const state = h("section", { class: "path-state", "aria-live": "polite", "aria-label": "State" });
  const answer = h("div", { class: "path-answer" });
  const zone = dropZone("Drop PATH.nc or PATH.csv, and STOCK.stl", "The program or table of the tool's tip; the stock, where it is no block.", take, { small: true, folder: false });
  let path = null;
  let following = null;
  let job = query.get("job");
  add(
    place,
    head("Paths", "What a tool does along a program: the part that is left, chatter, forces and form errors, move by move."),
    h("div", { class: "paths" }, h("div", { class: "path-asked" }, zone, form.element), h("div", { class: "path-bench" }, state, answer)),
  );
  fill(answer, h("p", { class: "soft" }, "Drop a path, say what the stock is, and cut along it: the part appears here."));

  const address = () => remember("paths", { ...form.state(), job });

  async function take(files) {
    for (const file of files) {
      try {
        clearFaults(form.element);
        if (/\.stl$/i.test(file.name)) form.stock(file);
        else await takePath(file);
      } catch (error) {
        failed(form.element, error);
      }
    }
  }

  async function takePath(file) {
    const kind = /\.csv$/i.test(file.name) ? "text/csv" : "text/x-gcode";
    const told = await (await send("POST", "paths/preview", { body: await file.text(), headers: { "Content-Type": kind } })).json();
    path = file;
    form.path(file, told);
  }

  form.element.addEventListener(
    "submit",
    busy(form.button, async () => {
      clearFaults(form.element);
      const body = new FormData();
      body.append("query", JSON.stringify(form.query()));
      body.append("path", path);
      if (form.surface) body.append("stock", form.surface);
      try {
        const begun = await (await send("POST", `paths/${form.kind}`, { body })).json();
        // the job goes on for whoever has left, and is nobody's to follow here
        if (!place.isConnected) return;
        job = begun.id;
        address();
        watch(begun);
      } catch (error) {
        failed(form.element, error);
      }
    }),
  );

  /** Show how far a job is, and its answer once it is done. */
  async function watch(begun) {
    following?.abort();
    const mine = (following = new AbortController());
    fill(answer);
    told(begun);
    try {
      const on = (event, data) => {
        if (event === "progress" || event === "end") told(data);
        return event === "end";
      };
      if (RUNNING.includes(begun.state)) await follow(`paths/${begun.id}/events`, on, mine.signal);
      if (mine.signal.aborted) return;
      fill(answer, waiting("The part is fetched …"));
      const found = await get(`paths/${begun.id}`, { signal: mine.signal });
      fill(state);
      if (found.answer) fill(answer, pathAnswer(found.answer, begun.id));
      else {
        fill(answer);
        const ended = found.job.problem ?? { detail: `The job is ${found.job.state}.` };
        if (found.job.state === "failed") failed(form.element, new Problem(0, ended));
        fill(state, note(found.job.state === "failed" ? "bad" : "", ended.detail));
      }
    } catch (error) {
      if (error.name !== "AbortError") failed(state, error);
    }
  }

  function told(now) {
    if (!RUNNING.includes(now.state)) return void fill(state);
    const share = shareOf(now);
    const stop = h("button", { type: "button" }, "Cancel");
    stop.addEventListener(
      "click",
      busy(stop, async () => {
        try {
          await send("DELETE", `paths/${now.id}`);
        } catch (error) {
          failed(state, error);
        }
      }),
    );
    fill(
      state,
      h(
        "div",
        { class: "standing" },
        h("p", { class: "waiting" }, `${wordsOf(now)}, for ${Math.round(secondsIn(now))} s`),
        stop,
        h("progress", { max: "1", "aria-label": "How far it is", ...(share === null ? {} : { value: String(share) }) }),
      ),
    );
  }

  if (job) {
    try {
      watch((await get(`paths/${job}`)).job);
    } catch (error) {
      failed(state, error);
    }
  }
  return () => following?.abort();
}
