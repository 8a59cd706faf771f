// Forces as they come: a data logger's stream that is watched, or a recording that is played.
import { get, Problem } from "../api.js";
import { add, card, empty, fill, h, head, link, mark, note, table } from "../dom.js";
import { legend, SERIES, uplot } from "../charts.js";
import { liveChart } from "../live_chart.js";
import { field, select } from "../forms.js";
import { keep, to } from "../router.js";
import { open, Window } from "../stream.js";
import { factor, plain, q } from "../units.js";
import { leftOut } from "./force_results.js";
import { ground, recordingPicker, tabs } from "./forces.js";

/** The seconds that the chart shows. */
const SECONDS = 4;

export async function view(_args, query, place) {
  const here = await ground(place, "Live forces");
  if (!here) return undefined;
  const picker = await recordingPicker(here, query, { air: true });
  const rate = select(
    [
      ["0.1", "ten times slower"],
      ["0.25", "four times slower"],
      ["1", "as recorded"],
      ["4", "four times faster"],
    ],
    query.get("rate") ?? "1",
  );
  const streams = h("div");
  const stop = h("button", { type: "button", hidden: true }, "Stop");
  const freeze = h("button", { type: "button", hidden: true, "aria-pressed": "false" }, "Hold the picture");
  const fault = h("div", { role: "alert" });
  const board = h("dl", { class: "facts" });
  const chartBox = h("div", { class: "live-chart", role: "img", "aria-label": "Force over the last seconds" });
  const keys = h("div");
  const screen = h(
    "section",
    { class: "card", hidden: true },
    h("header", null, h("h2", null, "Force now"), h("span", { class: "row-of-buttons" }, freeze, stop)),
    board,
    keys,
    chartBox,
  );
  const play = h("button", { class: "primary" }, "Play");
  const form = h(
    "form",
    { class: "card", novalidate: true },
    h("h2", null, "Play a recording as if it were live"),
    picker.any
      ? h("div", { class: "fields broad" }, picker.fields, field("Speed of playing", rate))
      : empty("No recordings yet", "Upload a campaign, or connect a data logger.", link(to("recordings"), "To the recordings", "button")),
    picker.any ? h("p", null, play) : null,
  );
  add(place, head("Live forces", here.name, tabs("forces/live")), fault, screen, h("div", { class: "columns" }, streams, form));

  // a bucket for each column of the picture
  const perSecond = () => Math.max(100, Math.round(place.clientWidth / SECONDS));
  let close = null;
  let plot = null;
  let held = false;
  let frames = null;
  async function start(hello, about) {
    end();
    fill(fault);
    screen.hidden = false;
    stop.hidden = freeze.hidden = false;
    fill(board, fact("State", mark("busy", "settling")), fact("Of", about));
    const uPlot = await uplot();
    let data = null;
    let dirty = false;
    const seconds = SECONDS * Math.min(1, hello.replay?.rate ?? 1);
    const told = (event) => {
      if (event.event === "ready") {
        const bucket = event.envelope ?? hello.envelope;
        data = new Window(event.axes, event.sampling_rate_hz, bucket, seconds);
        const names = legend(event.axes.map((a, k) => ({ name: `F${a.toLowerCase()}`, series: SERIES[k] })));
        fill(keys, h("p", { class: "soft" }, leftOut(event.left_out_s)), names);
        plot?.destroy();
        plot = liveChart(uPlot, chartBox, event.axes, () => data);
      } else if (event.event === "status" || event.event === "end") fill(board, status(event, about));
      else if (event.event === "settling" || event.event === "restarted") fill(fault, note("doubt", event.detail));
    };
    const draw = () => {
      frames = requestAnimationFrame(draw);
      if (!dirty || held || !plot || document.hidden) return;
      dirty = false;
      plot.show(data.columns(factor("force")), Math.max(0, data.last - seconds), Math.max(seconds, data.last));
    };
    frames = requestAnimationFrame(draw);
    close = open(hello, {
      told,
      forces: (buffer) => {
        data?.take(buffer);
        dirty = true;
      },
      over: (reason) => {
        close = null;
        stop.hidden = true;
        if (reason) fill(fault, note("bad", reason));
        board.querySelector(".mark")?.replaceWith(mark(reason ? "bad" : "idle", reason ? "broken off" : "over"));
        cancelAnimationFrame(frames);
        list();
      },
    });
  }
  function end() {
    close?.();
    close = null;
    cancelAnimationFrame(frames);
    stop.hidden = true;
  }
  stop.addEventListener("click", () => {
    end();
    board.querySelector(".mark")?.replaceWith(mark("idle", "stopped"));
  });
  freeze.addEventListener("click", () => {
    held = !held;
    freeze.setAttribute("aria-pressed", String(held));
    freeze.replaceChildren(held ? "Go on" : "Hold the picture");
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    keep({ campaign: picker.which.value, recording: picker.recording.value, rate: rate.value === "1" ? null : rate.value, watch: null });
    const recording = await get(`campaigns/${picker.which.value}/recordings/${encodeURIComponent(picker.recording.value)}`).catch(
      () => null,
    );
    const times = Number(rate.value);
    const envelope = Math.max(1, Math.round(((recording?.sampling_rate_hz ?? 25_600) * Math.min(1, times)) / perSecond()));
    start(
      { replay: { campaign: picker.which.value, recording: picker.recording.value, rate: times }, machine: here.id, envelope },
      picker.recording.value,
    );
  });

  function watch(stream) {
    keep({ watch: stream.session });
    start(
      { watch: stream.session, envelope: Math.max(1, Math.round(stream.sampling_rate_hz / perSecond())) },
      stream.name || stream.tooling,
    );
  }

  async function list() {
    try {
      const { items } = await get("forces/streams");
      fill(
        streams,
        card(
          "Streams that are open",
          null,
          items.length
            ? table(
                "Open streams",
                [
                  { name: "Stream", cell: (s) => s.name || `…${s.session.slice(-6)}` },
                  { name: "Tooling", cell: (s) => s.tooling },
                  { name: "Samples", number: true, cell: (s) => plain(s.samples) },
                  { name: "Lost", number: true, cell: (s) => plain(s.lost) },
                  {
                    name: "Watch",
                    cell: (s) =>
                      h(
                        "button",
                        {
                          type: "button",
                          onclick: () => watch(s),
                        },
                        "Watch",
                      ),
                  },
                ],
                items,
              )
            : h(
                "p",
                { class: "soft" },
                "No data logger sends at the moment. One that does appears here by itself; how it sends is described under API.",
              ),
        ),
      );
      return items;
    } catch (error) {
      fill(streams, note("bad", error.message));
      if (!(error instanceof Problem)) console.error(error);
      return [];
    }
  }
  const watched = (await list()).find((stream) => stream.session === query.get("watch"));
  if (watched) watch(watched);
  const poll = setInterval(() => !document.hidden && list(), 5000);
  const again = () => plot?.repaint();
  window.addEventListener("theme", again);
  window.addEventListener("units", again);
  return () => {
    clearInterval(poll);
    end();
    window.removeEventListener("theme", again);
    window.removeEventListener("units", again);
    plot?.destroy();
  };
}

const fact = (name, ...value) => h("div", null, h("dt", null, name), h("dd", null, value));

function status(event, about) {
  const live = event.stage === "live";
  return [
    fact("State", mark(live ? "good" : event.stage === "ended" ? "idle" : "busy", event.stage)),
    fact("Of", about),
    ...Object.entries(event.rms_n).map(([axis, n]) => fact(`F${axis.toLowerCase()}, RMS`, n === null ? "none yet" : q("force", n))),
    fact("Samples", plain(event.samples)),
    fact("Lost", h("span", { class: event.lost ? "fault" : null }, plain(event.lost))),
    fact("Dropped", h("span", { class: event.dropped ? "fault" : null }, plain(event.dropped))),
    fact("Delay", `${plain(event.delay_ms, 1, 1)} ms`),
    fact("Waiting", plain(event.backlog)),
    event.notes?.length ? h("div", { class: "whole" }, h("dt", null, "Notes"), h("dd", null, event.notes.join("; "))) : null,
  ];
}
