// The pictures of the patient's home, and over them the robot that will be.
import { make } from "./facts.js";
import { bars } from "./lens.js";
import { picture } from "./state.js";
import { nameOf, t } from "./words.js";

const FINER = 2; // the drawing over a picture has so many points for each of the picture's
const UNSURE = "#7fe0c4";
const SURE = "#00b386";

/** Fill what lies within either radius of a line between two points. */
function bar(context, [a, b], [c, d], [first, last]) {
  const length = Math.hypot(c - a, d - b) || 1;
  const [x, y] = [(b - d) / length, (c - a) / length]; // across it
  const corners = [[a + first * x, b + first * y], [c + last * x, d + last * y], [c - last * x, d - last * y], [a - first * x, b - first * y]];
  context.beginPath();
  corners.forEach((corner) => context.lineTo(...corner));
  context.fill();
  for (const [at, up, radius] of [[a, b, first], [c, d, last]]) {
    context.beginPath();
    context.arc(at, up, radius, 0, 2 * Math.PI);
    context.fill();
  }
}

/** Draw bars, in a picture's pixels, over it: how far they may be off below, the bars themselves above. */
function trace(will, canvas, found) {
  const [width, height] = [FINER * canvas.width, FINER * canvas.height];
  if (will.width !== width || will.height !== height) [will.width, will.height] = [width, height];
  const context = will.getContext("2d");
  context.setTransform(FINER, 0, 0, FINER, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  for (const [colour, thick] of [[UNSURE, "wide"], [SURE, "radii"]]) {
    context.fillStyle = colour;
    for (const one of found) bar(context, one.from, one.to, one[thick]);
  }
}

/** The pictures of the patient's home, each with its own age: one that freezes does not freeze the others. */
export class Cameras {
  constructor(element, names) {
    this.cameras = new Map();
    element.replaceChildren(...(names.length ? names : [""]).map((name) => {
      const box = make("div", "", { class: "camera none" });
      const canvas = make("canvas", "", { role: "img", "aria-label": t("picture.of", { camera: nameOf(name) }) });
      const over = make("p", "", { class: "over" });
      const will = make("canvas", "", { class: "will", "aria-hidden": "true" });
      box.append(canvas, will, over);
      this.cameras.set(name, { box, over, canvas, will, header: null });
      return box;
    }));
    this.speak();
  }

  speak() {
    for (const [name, { over, header }] of this.cameras) {
      if (!header) over.textContent = t(name ? "picture.none" : "picture.no_camera");
    }
  }

  has(name) {
    return this.cameras.has(name);
  }

  names() {
    return [...this.cameras.keys()].filter(Boolean);
  }

  /** Another robot is shown: none of its pictures came yet. */
  clear() {
    for (const camera of this.cameras.values()) {
      camera.header = null;
      camera.box.classList.add("none");
      camera.box.classList.remove("stale");
      camera.canvas.width = camera.canvas.height = 1;
    }
    this.speak();
  }

  /** Draw a picture; the canvas that shows it now. */
  take(header) {
    const camera = this.cameras.get(header.camera);
    if (camera) {
      const { canvas } = camera;
      if (canvas.width !== header.bitmap.width) canvas.width = header.bitmap.width;
      if (canvas.height !== header.bitmap.height) canvas.height = header.bitmap.height;
      canvas.getContext("2d").drawImage(header.bitmap, 0, 0);
      camera.header = header;
    }
    header.bitmap.close();
    return camera?.canvas;
  }

  /**
   * Over each picture that is not old, of a camera whose lens is known: the robot where it is by now. `posture`: what
   * `bars` takes; null where it is not foretold.
   */
  foretell(lenses, links, posture) {
    for (const [name, { box, canvas, will, header }] of this.cameras) {
      const lens = header && !box.classList.contains("stale") ? lenses?.[name] : null;
      const found = lens && posture ? bars(lens, links, posture, canvas.width, canvas.height) : [];
      if (found.length) trace(will, canvas, found);
      else if (will.width > 1) will.width = will.height = 1;
    }
  }

  /** Say how old each picture is now, and in `line` how old the oldest is. */
  tick(line, page_ms, stale_s) {
    let oldest = null;
    for (const { box, over, header } of this.cameras.values()) {
      if (!header) continue;
      const found = picture(header, page_ms, (performance.now() - header.arrived_ms) / 1000, stale_s);
      box.classList.remove("none");
      box.classList.toggle("stale", found.stale);
      if (found.stale) over.textContent = t(found.known ? "picture.stale" : "picture.stale_least", { age: found.age_s.toFixed(1) });
      if (!oldest || found.age_s > oldest.age_s) oldest = found;
    }
    if (!oldest || !line) return;
    const age = { age: oldest.age_s.toFixed(1), ms: (oldest.age_s * 1000).toFixed(0), bound: Math.ceil(oldest.bound_ms ?? 0) };
    line.textContent = t(!oldest.known ? "picture.age_unknown" : oldest.stale ? "picture.old" : "picture.age", age);
  }
}
