// A force stream: the WebSocket, and the window of the last seconds that the chart shows.
import { at, keyOf } from "./api.js";

/** Extremes of the last seconds, in rings: the oldest make way. */
export class Window {
  constructor(axes, rate, bucket, seconds) {
    this.size = Math.max(16, Math.ceil((rate / bucket) * seconds));
    this.step = bucket / rate;
    this.axes = axes;
    this.bucket = bucket;
    this.time = new Float64Array(this.size);
    this.low = axes.map(() => new Float32Array(this.size).fill(NaN));
    this.high = axes.map(() => new Float32Array(this.size).fill(NaN));
    this.next = 0;
    this.count = 0;
    this.rate = rate;
    this.last = 0;
  }

  /** Take a frame of the service: uint64 first sample, uint32 rows, uint32 axes, float32[rows, axes, 2]. */
  take(buffer) {
    const view = new DataView(buffer);
    const first = Number(view.getBigUint64(0, true));
    const rows = view.getUint32(8, true);
    const axes = view.getUint32(12, true);
    const values = new Float32Array(buffer, 16, rows * axes * 2);
    for (let r = 0; r < rows; r += 1) {
      const k = this.next;
      this.time[k] = (first + r * this.bucket) / this.rate;
      for (let a = 0; a < axes; a += 1) {
        this.low[a][k] = values[(r * axes + a) * 2];
        this.high[a][k] = values[(r * axes + a) * 2 + 1];
      }
      this.next = (k + 1) % this.size;
      this.count = Math.min(this.count + 1, this.size);
    }
    if (rows) this.last = this.time[(this.next + this.size - 1) % this.size];
  }

  /** Columns for uPlot, oldest first: time, then low and high of each axis; a gap in time breaks the line. */
  columns(times) {
    const start = (this.next + this.size - this.count) % this.size;
    const found = [new Array(this.count), ...this.axes.flatMap(() => [new Array(this.count), new Array(this.count)])];
    for (let i = 0; i < this.count; i += 1) {
      const k = (start + i) % this.size;
      found[0][i] = this.time[k];
      for (let a = 0; a < this.axes.length; a += 1) {
        const gap = i > 0 && this.time[k] - found[0][i - 1] > 1.6 * this.step;
        found[1 + 2 * a][i] = gap ? null : this.low[a][k] * times;
        found[2 + 2 * a][i] = gap ? null : this.high[a][k] * times;
      }
    }
    return found;
  }
}

/** Open a stream with a hello; `on` has told(event), forces(buffer) and over(reason). */
export function open(hello, on) {
  const address = at("forces/stream").replace(/^http/, "ws");
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  let reason = "";
  socket.onopen = () => socket.send(JSON.stringify({ ...(keyOf() ? { key: keyOf() } : {}), format: "float32", ...hello }));
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") return on.forces(data);
    const event = JSON.parse(data);
    if (event.event === "problem") reason = event.problem.detail;
    return on.told(event);
  };
  socket.onclose = (event) => on.over(event.code === 1000 ? "" : reason || event.reason || "the connection was lost");
  return () => {
    socket.onclose = null;
    socket.close(1000);
  };
}
