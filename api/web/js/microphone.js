// The browser's microphone, as raw as it gives it, and a WAV file of what it heard.

/** What browsers do to a voice, and would do to a cut. */
const WORKED = { echoCancellation: "echo cancellation", noiseSuppression: "noise suppression", autoGainControl: "automatic gain" };

/** Why this browser cannot record here; empty where it can. */
export function whyNot() {
  if (!window.isSecureContext)
    return "Browsers hand the microphone only to pages that come over https, or from the machine itself. Ask whoever runs the service for an https address; until then, record with another app and drop its file here.";
  if (!navigator.mediaDevices?.getUserMedia || !window.AudioWorkletNode) return "This browser cannot record. Record with another app, and drop its file here.";
  return "";
}

/** Words for what the browser says when it gives no microphone. */
export function refusal(error) {
  if (error.name === "NotAllowedError") return "The microphone was not allowed. The browser's settings for this page can allow it again.";
  if (error.name === "NotFoundError") return "There is no microphone at this device.";
  return `The microphone cannot be used: ${error.message}`;
}

/**
 * Open the microphone and hand on its samples: `onblock(samples, peak)`. The person is asked for permission here.
 * Returns its rate, what the browser really does to the sound, in words, and how to close it.
 */
export async function openMicrophone(onblock) {
  const wanted = Object.fromEntries(Object.keys(WORKED).map((name) => [name, false]));
  const stream = await navigator.mediaDevices.getUserMedia({ audio: { ...wanted, channelCount: { ideal: 1 } } });
  try {
    const settings = stream.getAudioTracks()[0].getSettings();
    const context = contextOf(settings.sampleRate);
    await context.audioWorklet.addModule(new URL("./recorder.worklet.js", import.meta.url).href);
    const source = context.createMediaStreamSource(stream);
    const node = new AudioWorkletNode(context, "recorder", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
    node.port.onmessage = ({ data }) => onblock(data, data.reduce((most, sample) => Math.max(most, Math.abs(sample)), 0));
    source.connect(node);
    await context.resume();
    const close = () => {
      node.port.onmessage = null;
      for (const track of stream.getTracks()) track.stop();
      return context.close();
    };
    return { rate: context.sampleRate, done: done(settings), close };
  } catch (error) {
    for (const track of stream.getTracks()) track.stop();
    throw error;
  }
}

/** At the rate of the device, so that nothing is computed anew on the way. */
function contextOf(sampleRate) {
  try {
    return new AudioContext(sampleRate ? { sampleRate } : {});
  } catch {
    return new AudioContext();
  }
}

/** What is done to the sound after all: lists of what is on, and of what the browser does not tell. */
function done(settings) {
  const names = Object.keys(WORKED);
  return {
    on: names.filter((name) => settings[name]).map((name) => WORKED[name]),
    untold: names.filter((name) => settings[name] === undefined).map((name) => WORKED[name]),
  };
}

/** Blocks of samples as a WAV file of 32-bit floats: not rounded, not clipped. */
export function wavFile(blocks, rate, name) {
  const size = blocks.reduce((sum, block) => sum + 4 * block.length, 0);
  const view = new DataView(new ArrayBuffer(58 + size));
  let at = 0;
  const text = (words) => [...words].forEach((letter) => view.setUint8(at++, letter.charCodeAt(0)));
  const number = (value, bytes) => {
    if (bytes === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += bytes;
  };
  text("RIFF");
  number(50 + size, 4);
  text("WAVEfmt ");
  number(18, 4);
  // floats, one channel
  number(3, 2);
  number(1, 2);
  number(rate, 4);
  number(4 * rate, 4);
  number(4, 2);
  number(32, 2);
  number(0, 2);
  text("fact");
  number(4, 4);
  number(size / 4, 4);
  text("data");
  number(size, 4);
  for (const block of blocks)
    for (const sample of block) {
      view.setFloat32(at, sample, true);
      at += 4;
    }
  return new File([view], name, { type: "audio/wav" });
}
