// A card that records with the browser's microphone.
import { card, fill, h, note, whisper } from "../dom.js";
import { field, select } from "../forms.js";
import { openMicrophone, refusal, wavFile, whyNot } from "../microphone.js";
import { plain } from "../units.js";

/** Level below which nothing is heard [dB], and peak from which on the sound is cut off. */
const [QUIET, FULL] = [-60, 0.999];

const HOW = "Hold the phone near the cut, some 30 cm from the tool where that is safe, and begin while the tool is cutting.";

/** The card; `onfile(file)` gets what was recorded, `how` says how to record. `.stop()` gives the microphone back. */
export function recorderCard(onfile, how = HOW) {
  const box = h("div", { class: "view" });
  const why = whyNot();
  const seconds = select(
    [5, 10, 20, 30].map((each) => [String(each), `${each} s`]),
    "10",
  );
  const record = h("button", { type: "button", class: "primary", disabled: why !== "" }, "Record with the microphone");
  const stop = h("button", { type: "button", hidden: true }, "Stop and listen");
  const left = h("output", { class: "countdown", hidden: true });
  const meter = h("meter", { min: String(QUIET), max: "0", low: "-40", high: "-3", optimum: "-15", "aria-label": "Level" });
  const level = h("div", { class: "level", hidden: true }, meter, h("span", { class: "small soft" }, "level"));
  let microphone = null;
  let opening = false;
  let gone = false;

  async function begin() {
    if (opening || microphone) return;
    opening = true;
    record.disabled = true;
    fill(box);
    const blocks = [];
    let [count, loudest] = [0, 0];
    let rate = 0;
    try {
      microphone = await openMicrophone((block, peak) => {
        blocks.push(block);
        count += block.length;
        loudest = Math.max(loudest, peak);
        meter.value = Math.max(QUIET, 20 * Math.log10(peak + 1e-9));
        if (!rate) return;
        const rest = Number(seconds.value) - count / rate;
        left.textContent = `${Math.max(0, rest).toFixed(1)} s`;
        if (rest <= 0) end(blocks, rate, loudest);
      });
    } catch (error) {
      fill(box, note("bad", refusal(error)));
      record.disabled = false;
      return;
    } finally {
      opening = false;
    }
    if (gone) return close();
    rate = microphone.rate;
    stop.onclick = () => end(blocks, rate, loudest);
    shown(true);
    fill(box, settings(microphone));
    whisper("Recording");
    stop.focus();
  }

  function end(blocks, rate, loudest) {
    if (!microphone) return;
    const held = settings(microphone);
    close();
    whisper("Recorded");
    if (!blocks.length) return fill(box, note("bad", "Nothing came from the microphone."));
    fill(
      box,
      held,
      loudest >= FULL ? note("doubt", "It was too loud for the microphone, and cut off at the top: go further away.") : null,
      loudest === 0 ? note("bad", "The microphone gave silence: it may be muted.") : null,
    );
    onfile(wavFile(blocks, rate, `recording-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.wav`));
  }

  function close() {
    microphone?.close();
    microphone = null;
    shown(false);
  }

  function shown(recording) {
    record.disabled = recording;
    record.hidden = recording;
    for (const each of [stop, left, level]) each.hidden = !recording;
  }

  record.addEventListener("click", begin);
  const made = card(
    "Record it here",
    null,
    why ? note("doubt", why) : h("p", { class: "soft" }, how),
    h("div", { class: "recorder" }, field("Length", seconds), h("div", { class: "row-of-buttons" }, record, stop, left), level),
    box,
  );
  made.stop = () => {
    gone = true;
    close();
  };
  return made;
}

/** What the browser really does to the sound. */
function settings({ rate, done: { on, untold } }) {
  const at = `The microphone gives ${plain(rate)} samples a second.`;
  if (on.length)
    return note("doubt", `${at} This browser does not switch off ${on.join(", ")}: frequencies hold, how loud a line is and how it decays does not.`);
  if (untold.length) return note("doubt", `${at} Whether ${untold.join(", ")} are off, this browser does not tell.`);
  return h("p", { class: "soft small" }, `${at} Echo cancellation, noise suppression and automatic gain are off.`);
}
