// Pictures as bitmaps: JPEG each by itself, H.264 by the browser's own decoder, each after the one that it builds on.
// A picture whose predecessor is missing is not drawn: the one on the screen goes on ageing, and a picture that stands
// alone is asked for. A browser that cannot decode H.264 asks the console for JPEG.

const ASK_MS = 500;
const SLOW = 8; // pictures that the decoder may owe before it is taken for stuck

export class Pictures {
  /** `ask(camera)` asks for a picture that stands alone; `missing()` is called where this browser has no decoder. */
  constructor(ask, missing) {
    this.ask = ask;
    this.missing = missing;
    this.streams = new Map();
    this.era = 0;
  }

  /** Hands `show({...header, bitmap})` the picture once it is decoded; resolves when it was, or cannot be. */
  async take(header, bytes, show) {
    if (header.codec === "h264") return this.stream(header.camera).take(header, bytes, show);
    const era = this.era;
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
    if (era !== this.era) return bitmap.close();
    return show({ ...header, bitmap });
  }

  stream(camera) {
    if (!this.streams.has(camera)) this.streams.set(camera, new Stream(() => this.ask(camera), this.missing));
    return this.streams.get(camera);
  }

  /** Another robot, or another socket: what is decoded builds on nothing that came before, and that is not shown. */
  clear() {
    this.era++;
    for (const stream of this.streams.values()) stream.reset();
    this.streams.clear();
  }
}

class Stream {
  constructor(ask, missing) {
    this.request = ask;
    this.missing = missing;
    this.reset();
  }

  reset() {
    try {
      this.decoder?.close();
    } catch {
      // closed already, by an error
    }
    this.decoder = null;
    this.last = 0;
    this.waiting = new Map();
  }

  take(header, bytes, show) {
    const alone = header.after === 0;
    if (typeof VideoDecoder === "undefined") return this.cannot();
    if (this.waiting.size >= SLOW) this.reset();
    if (!alone && (header.after !== this.last || !this.decoder)) return this.needsKey();
    if (alone && !this.open(bytes)) return this.cannot();
    this.last = header.number;
    return new Promise((done) => {
      this.waiting.set(header.number, { header, show, done });
      try {
        this.decoder.decode(new EncodedVideoChunk({ type: alone ? "key" : "delta", timestamp: header.number, data: bytes }));
      } catch {
        this.fail();
      }
    });
  }

  /** A decoder for the stream that begins with these bytes; the one that runs goes on where the profile is the same. */
  open(bytes) {
    const codec = codecOf(bytes);
    if (!codec) return false;
    if (this.decoder?.state === "configured" && this.codec === codec) return true;
    this.reset();
    const decoder = new VideoDecoder({ output: (frame) => this.output(decoder, frame), error: (error) => decoder === this.decoder && this.fail(error) });
    decoder.configure({ codec, optimizeForLatency: true });
    [this.decoder, this.codec] = [decoder, codec];
    return true;
  }

  async output(decoder, frame) {
    const found = this.waiting.get(frame.timestamp);
    // in the order in which they went in: what came before this one will not come any more
    for (const number of [...this.waiting.keys()]) {
      if (number > frame.timestamp) break;
      if (number < frame.timestamp) this.waiting.get(number).done();
      this.waiting.delete(number);
    }
    if (!found || decoder !== this.decoder) return frame.close();
    try {
      const bitmap = await createImageBitmap(frame);
      if (decoder === this.decoder) found.show({ ...found.header, bitmap });
      else bitmap.close();
    } finally {
      frame.close();
      found.done();
    }
  }

  fail(error) {
    for (const { done } of this.waiting.values()) done();
    this.reset();
    if (error?.name === "NotSupportedError") this.cannot();
    else this.needsKey();
  }

  needsKey() {
    this.seldom(this.request);
  }

  /** This browser has no decoder, or none for this profile. */
  cannot() {
    this.seldom(this.missing);
  }

  seldom(ask) {
    const now_ms = performance.now();
    if (now_ms - (this.asked_ms ?? -ASK_MS) < ASK_MS) return;
    this.asked_ms = now_ms;
    ask();
  }
}

/** "avc1.42C00D" of the sequence parameter set in a picture that stands alone (Annex B); null where there is none. */
export function codecOf(bytes) {
  for (let i = 0; i + 6 < bytes.length; i++) {
    if (bytes[i] || bytes[i + 1] || bytes[i + 2] !== 1 || (bytes[i + 3] & 31) !== 7) continue;
    return `avc1.${[4, 5, 6].map((k) => bytes[i + k].toString(16).padStart(2, "0").toUpperCase()).join("")}`;
  }
  return null;
}
