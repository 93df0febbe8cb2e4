// The pictures of the patient's home: one large, those of the other cameras beside it. Over the large one the robot
// that will be.
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

/** The head first, for it is what the operator looks through; then by name, so that a key means the same each time. */
const inOrder = (a, b) => (b === "head") - (a === "head") || (a < b ? -1 : 1);

/** The pictures of the patient's home, each with its own age: one that freezes does not freeze the others. */
export class Cameras {
  /** `looks(name)` is called with the camera whose picture is large now. */
  constructor(element, names, looks) {
    this.element = element;
    this.looks = looks;
    this.cameras = new Map();
    this.large = "";
    this.add(names.length ? names : [""]);
  }

  /** Give a place to cameras that have none; those that have one keep their picture. */
  add(names) {
    const fresh = names.filter((name) => !this.cameras.has(name));
    if (!fresh.length) return;
    this.cameras.delete("");
    for (const name of fresh) this.cameras.set(name, this.place(name));
    this.cameras = new Map([...this.cameras].sort(([a], [b]) => inOrder(a, b)));
    this.element.replaceChildren(...[...this.cameras.values()].map(({ box }) => box));
    this.show(this.chosen ? this.large : this.names()[0] ?? "");
    this.speak();
  }

  place(name) {
    const box = make("div", "", { class: "camera none" });
    const canvas = make("canvas", "", { role: "img" });
    const over = make("p", "", { class: "over" });
    const will = make("canvas", "", { class: "will", "aria-hidden": "true" });
    const note = make("p", "", { class: "lens-note" });
    const pick = make("button", "", { type: "button", class: "pick" });
    box.append(canvas, will, over, note, pick);
    box.addEventListener("click", () => this.choose(name));
    return { box, over, canvas, will, note, pick, header: null };
  }

  speak() {
    [...this.cameras].forEach(([name, { over, header, canvas, pick }], i) => {
      canvas.setAttribute("aria-label", t("picture.of", { camera: nameOf(name) }));
      if (!header) over.textContent = t(name ? "picture.none" : "picture.no_camera");
      pick.id = `camera-${i + 1}`;
      pick.hidden = this.cameras.size < 2;
      pick.title = t("picture.pick", { camera: nameOf(name) });
      pick.replaceChildren(make("kbd", String(i + 1)), make("span", nameOf(name)));
    });
  }

  names() {
    return [...this.cameras.keys()].filter(Boolean);
  }

  /** A person wants this camera's picture large. */
  choose(name) {
    if (!name || !this.cameras.has(name)) return;
    this.chosen = true;
    if (name !== this.large) this.show(name);
  }

  /** As the keys 1, 2, 3 say it. */
  chooseAt(place) {
    this.choose(this.names()[place]);
  }

  show(name) {
    const other = name !== this.large;
    this.large = name;
    this.element.dataset.beside = this.cameras.size - 1;
    for (const [each, { box, pick, will, note }] of this.cameras) {
      box.classList.toggle("large", each === name);
      pick.setAttribute("aria-pressed", each === name);
      if (each === name) continue;
      will.width = will.height = 1;
      note.textContent = "";
    }
    if (other) this.looks(name);
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
   * Over the large picture, if it is not old and its camera's lens is known: the robot where it is by now. `posture`:
   * what `bars` takes; null where it is not foretold.
   */
  foretell(lenses, links, posture) {
    const camera = this.cameras.get(this.large);
    if (!camera) return;
    const { box, canvas, will, note, header } = camera;
    const drawn = header && posture && !box.classList.contains("stale");
    const lens = lenses?.[this.large];
    const found = drawn && lens ? bars(lens, links, posture, canvas.width, canvas.height) : [];
    if (found.length) trace(will, canvas, found);
    else if (will.width > 1) will.width = will.height = 1;
    const words = drawn && lenses && !lens ? t("picture.no_lens") : "";
    if (note.textContent !== words) note.textContent = words;
  }

  /** Say how old each picture is now, and in `line` how old the large one is. */
  tick(line, page_ms, stale_s) {
    let large = null;
    for (const [name, { box, over, header }] of this.cameras) {
      if (!header) continue;
      const found = picture(header, page_ms, (performance.now() - header.arrived_ms) / 1000, stale_s);
      box.classList.remove("none");
      box.classList.toggle("stale", found.stale);
      if (found.stale) over.textContent = t(found.known ? "picture.stale" : "picture.stale_least", { age: found.age_s.toFixed(1) });
      if (name === this.large) large = found;
    }
    if (!line) return;
    const age = large && { age: large.age_s.toFixed(1), ms: (large.age_s * 1000).toFixed(0), bound: Math.ceil(large.bound_ms ?? 0) };
    line.textContent = large ? t(!large.known ? "picture.age_unknown" : large.stale ? "picture.old" : "picture.age", age) : "";
  }
}
