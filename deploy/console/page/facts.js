// The facts beside the picture and the robot: latency and its last minute, link, suit, events, joints.
import { FILLED, SHAPES } from "./state.js";
import { chosen, nameOf, t } from "./words.js";

const $ = (id) => document.getElementById(id);
const NS = "http://www.w3.org/2000/svg";

/** An element with text and attributes: what a robot or a person wrote is only ever text. */
export function make(tag, text = "", attributes = {}) {
  const element = document.createElement(tag);
  element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

export function draw(tag, attributes, parent) {
  const element = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  parent?.append(element);
  return element;
}

const fixed = (value, digits = 0) => (value === null || value === undefined ? "–" : value.toFixed(digits));

export function latencyNow(latency) {
  $("late-ms").textContent = fixed(latency?.ms);
  const bound = latency?.ms === null || latency?.ms === undefined ? "" : `± ${fixed(latency.bound_ms, 1)} `;
  $("late-bound").textContent = `${bound}ms`;
  $("late-now").classList.toggle("untrusted", latency?.trusted === false);
  $("late-now").title = latency?.trusted === false ? t("late.untrusted") : "";
}

/** The last minute as a curve with its bound as a band. Loaded late: without it the figures are still there. */
export class Minute {
  constructor(element, Plot) {
    const axis = { stroke: "#b6c2ce", grid: { stroke: "#2d3744", width: 1 }, ticks: { show: false } };
    this.element = element;
    this.plot = new Plot({
      ...this.size(), cursor: { show: false }, legend: { show: false }, padding: [6, 8, 0, 0],
      scales: { x: { time: false, range: [-60, 0] }, y: { range: (_, low, high) => [0, Math.max(20, 1.15 * (high ?? low ?? 0))] } },
      axes: [
        { ...axis, size: 22, values: (_, at) => at.map((s) => `${s} s`) },
        { ...axis, size: 46, splits: (_, __, low, high) => [low, high / 2, high].map(Math.round) },
      ],
      series: [{}, { stroke: "#56b4e9", width: 2.5 }, { stroke: "transparent" }, { stroke: "transparent" }],
      bands: [{ series: [2, 3], fill: "rgba(86, 180, 233, .35)" }],
    }, [[], [], [], []], element);
    new ResizeObserver(() => this.plot.setSize(this.size())).observe(element);
  }

  size() {
    return { width: Math.max(50, this.element.clientWidth), height: Math.max(40, this.element.clientHeight) };
  }

  show(minute) {
    const add = (sign) => minute.map(([, ms, bound]) => (ms === null ? null : ms + sign * (bound ?? 0)));
    this.plot.setData([minute.map(([s]) => s), minute.map(([, ms]) => ms), add(1), add(-1)]);
  }
}

export function link(facts) {
  const { link: found, latency } = facts;
  const word = found?.word ?? "unknown";
  const line = $("link");
  line.replaceChildren(`${t("link")} `, make("b", t(`link.${word}`), { "data-word": word }));
  if (found && word !== "unknown") {
    line.append(` · ${t("link.lost", { percent: fixed(found.lost_percent, 1), ms: fixed(found.jitter_ms) })}`);
  }
  line.title = found?.why ?? "";
  const creep = latency?.creep?.alarm ? latency.creep.words || t("late.creeps") : "";
  const note = $("late-note");
  note.textContent = creep || found?.needs || (word === "good" ? parts(latency?.stages ?? []) : found?.why ?? "");
  note.classList.toggle("untrusted", Boolean(creep || found?.needs));
  note.title = [note.textContent, found?.why].join("\n");
}

/** The stages in three parts: until the command is sent, the line, and the robot until it moves. */
function parts(stages) {
  const line = stages.findIndex((stage) => stage.name.startsWith("put"));
  if (line < 0) return "";
  const sum = (some) => fixed(some.reduce((total, stage) => total + (stage.mean_ms ?? 0), 0), 1);
  return t("late.parts", { operator: sum(stages.slice(0, line)), line: sum([stages[line]]), robot: sum(stages.slice(line + 1)) });
}

const MARKS = { attention: "!", invalid: "■", silent: "✕", unknown: "?" };
const WEIGHT = ["silent", "invalid", "attention", "unknown", "ok"];

/** The suit as a figure seen from behind, arms a little away from the body, and in words what needs attention. */
export class BodyFigure {
  constructor(element, nodes) {
    this.svg = draw("svg", { role: "img", "aria-label": t("figure") });
    element.replaceChildren(this.svg);
    this.nodes = nodes;
    const at = new Map([["world", [0, 0, 0]]]);
    this.marks = new Map();
    const lines = [];
    for (const node of nodes) {
      const from = plus(at.get(node.parent) ?? [0, 0, 0], node.origin_m ?? [0, 0, 0]);
      at.set(node.name, from);
      const children = nodes.filter((other) => other.parent === node.name);
      const last = [0, 0, 2 * (node.node_m?.[2] ?? -0.05)];
      const end = children.length ? mean(children.map((child) => child.origin_m)) : last;
      lines.push([node.name, flat(from), flat(plus(from, end))]);
    }
    const x = lines.flatMap(([, a, b]) => [a[0], b[0]]);
    const y = lines.flatMap(([, a, b]) => [a[1], b[1]]);
    const [left, top] = [Math.min(...x) - 0.09, Math.min(...y) - 0.12];
    const [width, height] = [Math.max(...x) + 0.09 - left, Math.max(...y) + 0.09 - top];
    this.svg.setAttribute("viewBox", `${left} ${top} ${width} ${height}`);
    this.unit = Math.max(width, height) / 30;
    this.skeleton(lines);
    for (const [name, a, b] of lines) {
      const bone = draw("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1], "stroke-linecap": "round" }, this.svg);
      this.marks.set(name, { bone, middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] });
    }
    this.over = draw("g", {}, this.svg);
  }

  /** What is no sensor: from a segment's end to the joints of those that hang on it, and the head's outline. */
  skeleton(lines) {
    const of = new Map(lines.map(([name, a, b]) => [name, { a, b }]));
    for (const node of this.nodes) {
      const [own, above] = [of.get(node.name), of.get(node.parent)];
      if (above) draw("line", { x1: above.b[0], y1: above.b[1], x2: own.a[0], y2: own.a[1], stroke: "#55626f", "stroke-width": this.unit * 0.5 }, this.svg);
      if (node.name === "head") draw("circle", { cx: own.b[0], cy: own.b[1], r: this.unit * 2.4, fill: "#161c24", stroke: "#55626f", "stroke-width": this.unit * 0.5 }, this.svg);
    }
  }

  show(levels) {
    this.over.replaceChildren();
    const colours = { attention: "#f0e442", invalid: "#e69f00", silent: "#ff8a3d", unknown: "#66727e" };
    for (const [name, { bone, middle }] of this.marks) {
      const level = levels.get(name) ?? "unknown";
      const hurt = level !== "ok" && level !== "unknown";
      bone.setAttribute("stroke", colours[level] ?? "#c9d3dc");
      bone.setAttribute("stroke-width", this.unit * (hurt ? 1.5 : 0.8));
      if (level === "silent") bone.setAttribute("stroke-dasharray", this.unit * 1.2);
      else bone.removeAttribute("stroke-dasharray");
      if (!hurt) continue;
      draw("circle", { cx: middle[0], cy: middle[1], r: this.unit * 1.7, fill: "#0d1117", stroke: colours[level], "stroke-width": this.unit * 0.4 }, this.over);
      const letter = draw("text", { x: middle[0], y: middle[1] + this.unit * 0.8, "text-anchor": "middle", "font-size": this.unit * 2.3, "font-weight": 700, fill: "#ffffff" }, this.over);
      letter.textContent = MARKS[level];
    }
  }
}

const plus = (a, b) => a.map((each, i) => each + b[i]);
const mean = (points) => [0, 1, 2].map((i) => points.reduce((sum, p) => sum + (p ?? [0, 0, 0])[i], 0) / points.length);
/** From behind: left is left. What is below and beside the shoulders is drawn a little further out. */
const flat = ([, y, z]) => [-(y + Math.sign(Math.round(y * 20)) * Math.max(0, 1.42 - z) * 0.3), -z];

/** What needs attention: sensors of the suit, then the robot's own faults, then what the shift says. */
export function attention(facts, figure) {
  const nodes = [...(facts.nodes ?? [])];
  figure?.show(new Map(nodes.map((node) => [node.name, node.level])));
  const list = $("nodes");
  list.replaceChildren();
  const bad = nodes.filter((node) => node.level !== "ok");
  bad.sort((a, b) => WEIGHT.indexOf(a.level) - WEIGHT.indexOf(b.level));
  const item = (level, name, words) => {
    const entry = make("li", "", { "data-level": level });
    entry.append(make("b", name), make("span", words, words ? { lang: "en" } : {}));
    list.append(entry);
  };
  const unknown = bad.filter((node) => node.level === "unknown");
  for (const [name, words] of Object.entries(facts.faults ?? {})) item("invalid", `${t("robot")}: ${nameOf(name)}`, words);
  for (const node of bad.filter((each) => each.level !== "unknown")) {
    item(node.level, `${nameOf(node.name)}: ${t(`level.${node.level}`)}`, node.words ?? "");
  }
  for (const words of facts.shift ?? []) item("attention", t("shift"), words);
  if (list.children.length) return;
  if (unknown.length || !nodes.length) item("unknown", t("suit.unknown"), "");
  else item("ok", t("suit.ok", { count: nodes.length }), "");
}

/** What happened, newest first. Only what is new is added, so that a reader's place in the list stays. */
export class Events {
  constructor(list) {
    this.list = list;
    this.entries = new Map();
  }

  show(events) {
    const now_ms = performance.now();
    for (const event of events) {
      if (this.entries.has(event.id)) continue;
      const entry = make("li", "", { "data-what": event.what });
      const words = make("p", "", { title: event.text });
      const kind = make("b", "", { "data-kind": event.what });
      words.append(kind, make("span", event.text, { lang: "en" }));
      entry.append(make("time"), words);
      this.entries.set(event.id, { entry, at_ms: now_ms - 1000 * event.age_s });
      this.list.prepend(entry);
    }
    while (this.list.children.length > 50) this.list.lastChild.remove();
    const kept = new Set(events.map((event) => event.id));
    for (const [id, { entry }] of this.entries) {
      if (kept.has(id)) continue;
      entry.remove();
      this.entries.delete(id);
    }
    this.tick();
  }

  tick() {
    for (const { entry, at_ms } of this.entries.values()) {
      // the words are English: in another language, the kind of event stands before them
      const kind = entry.querySelector("b");
      kind.textContent = chosen() === "en" ? "" : `${t(`event.${kind.dataset.kind}`)} `;
      entry.firstChild.textContent = ago((performance.now() - at_ms) / 1000);
    }
  }
}

export function ago(seconds) {
  if (seconds < 60) return t("ago.s", { n: Math.floor(seconds) });
  if (seconds < 3600) return t("ago.min", { n: Math.floor(seconds / 60) });
  return t("ago.h", { n: Math.floor(seconds / 3600) });
}

/** The joints as numbers, in degrees and N m; `drives` adds what the drives tell: their torque, their temperature. */
export class JointTable {
  constructor(element, joints, drives = false) {
    this.columns = ["encoder", "setpoint", "target", "external", ...(drives ? ["effort", "temperature"] : [])];
    const table = make("table");
    const head = make("tr");
    head.append(make("th", t("column.joint")));
    for (const key of this.columns) head.append(make("th", t(`column.${key}`), { class: "number" }));
    table.append(head);
    this.rows = joints.map((joint) => {
      const row = make("tr", "", { "data-joint": joint.name });
      row.append(make("td", nameOf(joint.name)));
      for (const key of this.columns) row.append(make("td", "–", { class: "number", "data-key": key }));
      table.append(row);
      return row;
    });
    element.replaceChildren(table);
  }

  show(view, drives) {
    const degrees = (values) => values?.map((rad) => (rad === null ? null : (rad * 180) / Math.PI));
    const values = {
      encoder: degrees(view.encoder), setpoint: degrees(view.setpoint), target: degrees(view.target),
      external: view.external_nm, effort: view.effort_nm ?? drives?.effort_nm, temperature: drives?.temperature_c,
    };
    this.rows.forEach((row, j) => {
      this.columns.forEach((key, i) => {
        const words = fixed(values[key]?.[j], 1);
        if (row.children[i + 1].textContent !== words) row.children[i + 1].textContent = words;
      });
      const [measured, aimed] = [values.encoder?.[j], values.target?.[j]];
      row.classList.toggle("limited", view.limited?.includes(j) ?? false);
      row.title = view.limited?.includes(j) ? t("limited") : "";
      row.classList.toggle("off", typeof measured === "number" && typeof aimed === "number" && Math.abs(measured - aimed) > 5);
    });
  }
}

/** The figure of a state: each differs from all others without its colour. */
export function shape(id) {
  const svg = draw("svg", { viewBox: "0 0 100 100", "aria-hidden": "true", fill: "none", stroke: "currentColor", "stroke-width": 11, "stroke-linejoin": "round", "stroke-linecap": "round" });
  draw("path", { d: SHAPES[id] ?? SHAPES.starting, fill: FILLED.has(id) ? "currentColor" : "none" }, svg);
  return svg;
}
