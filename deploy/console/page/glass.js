// From scene to eye: reads the time that a drawn picture itself shows, and reports when it was on the screen.
import { ConsoleClock } from "./clock.js";
import { readCodes } from "./picture_code.js";

const EVERY_MS = 500; // of one camera
const RARELY_MS = 5000; // where no code was found

export class Glass {
  constructor(link) {
    this.link = link;
    this.clock = new ConsoleClock().start();
    this.next_ms = new Map();
    this.canvas = document.createElement("canvas");
  }

  /** A picture was drawn just now. It is on the screen at the latest when the frame after the next one begins. */
  drawn(camera, number, source) {
    const now_ms = performance.now();
    if (document.hidden || now_ms < (this.next_ms.get(camera) ?? 0)) return;
    this.next_ms.set(camera, now_ms + EVERY_MS);
    const [canvas, width, height] = [this.canvas, source.width, source.height];
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(source, 0, 0);
    const kept = context.getImageData(0, 0, width, height);
    requestAnimationFrame((first_ms) =>
      requestAnimationFrame((second_ms) => this.report(camera, number, kept, first_ms, second_ms)));
  }

  report(camera, number, kept, first_ms, second_ms) {
    const counts = readCodes(kept);
    if (!counts.length) this.next_ms.set(camera, performance.now() + RARELY_MS);
    const shown = this.clock.console(second_ms);
    if (!counts.length || !shown) return;
    // one refresh: between the two frames it came on the screen; how long the screen itself takes, nobody here knows
    const bound_ms = shown.bound_ms + Math.max(0, second_ms - first_ms);
    this.link.send({ kind: "shown", camera, number, counts: counts.slice(0, 4), at_ms: shown.at_ms, bound_ms });
  }
}

/** "scene to eye 104 ± 21 ms": of the camera whose figure is the largest; null where none was measured. */
export function worst(glass) {
  const known = Object.values(glass ?? {});
  return known.length ? known.reduce((a, b) => (b.ms > a.ms ? b : a)) : null;
}
