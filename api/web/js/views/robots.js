// A milling robot: its posture by sliders or along a path, what it is there, and lobes that follow.
import { all, get, part, post, Problem, send } from "../api.js";
import { armPicture } from "../arm_picture.js";
import { add, card, fill, h, head, link, note, tell } from "../dom.js";
import { dropZone } from "../drop.js";
import { busy, clearFaults, confirmed, failed, showProblem } from "../forms.js";
import { remember, to } from "../router.js";
import { mapCard, modesCard, postureCard, postureLobes } from "./robot_answers.js";
import { jointSliders, PUBLISHED, robotForm } from "./robot_form.js";

const NAME = /[^A-Za-z0-9 ._+()-]/g;
/** How long a hand rests before its posture is asked about [ms]. */
const REST = { posture: 120, lobes: 400 };

export async function view(_args, query, place) {
  const [kept, toolings, { items: materials }, { items: examples }] = await Promise.all([all("robots"), all("toolings"), get("materials"), get("examples")]);
  const own = kept.map((each) => ({ ...each, words: each.label === each.name ? each.name : `${each.name}: ${each.label}` }));
  const published = Object.keys(PUBLISHED)
    .filter((name) => !kept.some((each) => each.name === name))
    .map((name) => ({ name, joints: PUBLISHED[name].length, published: true, words: aboutOf(name, examples) }));
  const robots = [...own, ...published];

  const picture = armPicture();
  const fault = h("div");
  const posture = h("div");
  const modes = h("div");
  const lobes = postureLobes();
  const map = h("div", { class: "wide" });
  const along = h("div", { class: "along" });
  const answer = h("div", { class: "robot-answer" });
  let joints = [];
  let path = { places: [], postures: [], name: "" };
  let weighed = false;
  const running = {};
  const timers = {};

  const sliders = jointSliders(moved, (k) => picture.show({ chosen: k }));
  const form = robotForm({ robots, toolings, materials, query, sliders, onrobot: () => load(null), onask: asked, onforget: forget });
  const zone = dropZone("Drop ROBOT.toml or PATH.csv", "An arm is kept under the name of its file; a path is that of the tool's tip.", take, { small: true, folder: false });
  const pictured = card("The arm", null, picture.element, along);
  pictured.classList.add("arm-card");
  fill(answer, fault, lobes.box, map, posture, modes);
  add(
    place,
    head("Robots", "A milling robot is a machine with a posture: it gives way, vibrates and chatters differently at every one."),
    h("div", { class: "robot" }, h("div", { class: "robot-bench" }, pictured, h("div", { class: "robot-asked" }, form.element, zone)), answer),
  );

  /** Ask once more, and give up what was asked before; `after` are milliseconds of rest. */
  function later(name, work, after) {
    clearTimeout(timers[name]);
    running[name]?.abort();
    timers[name] = setTimeout(async () => {
      const mine = (running[name] = new AbortController());
      try {
        await work(mine.signal);
      } catch (error) {
        if (error.name === "AbortError" || mine.signal.aborted) return;
        if (!showsIn(error)) failed(fault, error);
      }
    }, after);
  }
  /** Whether a field of the form is at fault, which says so itself. */
  function showsIn(error) {
    const named = (error.errors ?? []).some((each) => form.element.querySelector(`[data-field="${CSS.escape(each.field)}"]`));
    if (named) showProblem(form.element, error, { focus: false });
    return named;
  }

  function moved() {
    picture.show({ angles: sliders.angles });
    remember("robots", form.state());
    answer.classList.add("before");
    later("posture", askPosture, REST.posture);
    later("lobes", askLobes, REST.lobes);
  }

  async function askPosture(signal, drawing = false) {
    const found = await post("robots/posture", { robot: form.posed(), tooling: form.tooling || null, drawing }, { signal });
    if (drawing) joints = found.drawing.joints;
    fill(fault);
    answer.classList.add("known");
    answer.classList.remove("before");
    weighed = found.mass_kg !== null;
    fill(posture, postureCard(found, joints, sliders.angles, (angles) => (sliders.set(angles), moved())));
    fill(modes, modesCard(found));
    return found;
  }

  async function askLobes(signal) {
    clearFaults(form.element);
    if (!form.tooling || !weighed) return void (lobes.box.hidden = true);
    const faults = form.faults();
    if (faults.length) throw new Problem(0, { detail: "Something is not usable", errors: faults });
    const question = { robot: form.posed(), toolings: [form.tooling], ...form.cut(), bands: false, recommend: false };
    const found = await post("lobes", question, { signal });
    lobes.show(found.toolings[0], question.max_depth_mm);
  }

  /** Take another arm, at the angles of the address or at some of its own. */
  function load(written) {
    for (const name of Object.keys(timers)) {
      clearTimeout(timers[name]);
      running[name]?.abort();
    }
    fill(fault);
    fill(map);
    path = { places: [], postures: [], name: "" };
    showPath();
    const chosen = robots.find((each) => each.name === form.robot);
    const given = (written ?? "").split(/\s+/).filter(Boolean).map(Number);
    const usable = given.length === chosen.joints && given.every(Number.isFinite);
    sliders.angles = usable ? given : (PUBLISHED[chosen.name]?.slice(0, chosen.joints) ?? []);
    if (sliders.angles.length !== chosen.joints) sliders.angles = Array(chosen.joints).fill(0);
    redrawn(true);
  }

  /** Ask for the drawing, too: of another arm, or with another tool on it. */
  function redrawn(anew) {
    const draw = async (signal) => {
      const found = await askPosture(signal, true);
      if (anew) sliders.build(joints, sliders.angles);
      picture.show({ drawing: found.drawing, angles: sliders.angles });
      remember("robots", form.state());
      later("lobes", askLobes, 0);
    };
    later("drawing", draw, 0);
  }

  function asked(tool) {
    remember("robots", form.state());
    if (!tool) return moved();
    redrawn(false);
    if (path.places.length) follow();
  }

  async function take(files) {
    for (const file of files) {
      try {
        if (/\.toml$/i.test(file.name)) await keepArm(file);
        else await takePath(file);
      } catch (error) {
        failed(fault, error);
      }
    }
  }

  async function keepArm(file) {
    const name = file.name.replace(/\.toml$/i, "").replace(NAME, " ").trim().slice(0, 64) || "robot";
    await send("PUT", `robots/${part(name)}`, { body: await file.text(), headers: { "Content-Type": "application/toml" } });
    tell(`${name} is kept; what it replaces stays as a version.`);
    remember("robots", { ...form.state(), robot: name, q: null });
    window.dispatchEvent(new Event("refresh"));
  }

  async function takePath(file) {
    const read = await (await send("POST", "robots/path/preview", { body: file, headers: { "Content-Type": "text/csv" } })).json();
    path = { places: read.places, postures: [], name: file.name };
    await follow();
  }

  /** Find the postures along the path, from near the one that stands now. */
  async function follow() {
    fill(map);
    if (!form.tooling) return failed(fault, new Problem(0, { detail: "Choose a tooling: the path is that of its tip." }));
    try {
      const found = await post("robots/path", { robot: form.posed(), tooling: form.tooling, places: path.places });
      path.postures = found.postures_deg;
      fill(fault, found.warnings.length ? note("doubt", ...found.warnings) : null);
      showPath();
      sliders.set(path.postures[0]);
      moved();
    } catch (error) {
      path.postures = [];
      showPath();
      failed(fault, error);
    }
  }

  function showPath() {
    picture.show({ path: path.places.map((row) => row.slice(0, 3)) });
    if (!path.postures.length) return void fill(along);
    const count = path.postures.length;
    const told = h("output", { for: "along" }, `1 of ${count}`);
    const slide = h("input", { type: "range", id: "along", min: 1, max: count, step: 1, value: 1 });
    slide.addEventListener("input", () => {
      const k = Number(slide.value);
      fill(told, `${k} of ${count}`);
      sliders.set(path.postures[k - 1]);
      moved();
    });
    const limits = h("button", { type: "button" }, "Limits along the path");
    limits.addEventListener("click", busy(limits, mapped));
    const away = h("button", { type: "button", class: "quiet", onclick: () => ((path = { places: [], postures: [], name: "" }), fill(map), showPath()) }, "Take it away");
    fill(along, h("label", { for: "along" }, `Place along ${path.name}: `, told), slide, h("div", { class: "row-of-buttons" }, limits, away));
  }

  async function mapped() {
    clearFaults(form.element);
    const question = { robot: { ...form.posed(), posture_deg: path.postures[0] }, tooling: form.tooling, places: path.places, ...form.cut() };
    try {
      const found = await post("robots/map", question);
      const { box, draw } = mapCard(found, question.max_depth_mm);
      fill(map, box);
      draw();
    } catch (error) {
      if (!showsIn(error)) failed(fault, error);
    }
  }

  async function forget(name) {
    if (!(await confirmed(`Forget ${name}?`, "Its versions stay in the trail of changes, and can be restored from there.", "Forget it"))) return;
    try {
      await send("DELETE", `robots/${part(name)}`);
      remember("robots", { ...form.state(), robot: null, q: null });
      window.dispatchEvent(new Event("refresh"));
    } catch (error) {
      failed(fault, error);
    }
  }

  if (!toolings.length) zone.before(note("", h("p", null, "No tooling yet: with one, lobes follow the posture. ", link(to("toolings"), "To the toolings"))));
  load(query.get("q"));
  return () => {
    for (const name of Object.keys(timers)) {
      clearTimeout(timers[name]);
      running[name]?.abort();
    }
  };
}

/** What an example says of itself: the arm's name. */
function aboutOf(name, examples) {
  const found = examples.find((each) => each.name === `${name}.toml`)?.about ?? name;
  return `${found.replace(/^A robot: /, "").split(",")[0]} (published)`;
}
