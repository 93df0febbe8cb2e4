// The page of calibration: leads as `tandem calibrate live` does; the console's own process counts and computes.
import { BodyFigure, make } from "./facts.js";
import { chosen, nameOf, t } from "./words.js";

const $ = (id) => document.getElementById(id);
const TICK = [660, 0.08]; // Hz, s
const NOW = [990, 0.5];
const TAKEN = [1320, 0.15];
let help = { post: async () => ({ done: false }), tell: () => {} };
let setup = null;
let shown = null; // the console's newest message
let figure = null;
let sound = null;
let heard = { step: "", second: 0, held: 0 }; // of the countdown, so that each second sounds once
let sure = false;
let written = ""; // the rows that stand in the list

export function wire(given) {
  help = given;
  $("lead-begin").addEventListener("click", begin);
  $("lead-word").addEventListener("click", word);
  $("lead-end").addEventListener("click", () => post({ do: "end" }));
}

export function prepare(found) {
  setup = found;
  figure = found.nodes?.length ? new BodyFigure($("led-figure"), found.nodes) : null;
  show();
}

export const speak = () => ((written = ""), show());
export function view() {}
export const facts = () => show();

export function calibration(message) {
  const before = shown?.view?.step;
  shown = message;
  if (before !== message.view?.step) sure = false;
  beeps(before, message);
  show();
}

/** F8, or the button: the word that Enter is for the command line. */
export function word() {
  if (!shown?.under_way || shown.computing) return;
  listen();
  const waits = shown.view?.step === "zero_pose";
  if (!waits && !sure) { // what is not complete is left behind only by a second press
    sure = true;
    return show();
  }
  sure = false;
  post({ do: "word" });
}

async function begin() {
  listen();
  const what = [...$("lead-what").querySelectorAll("input:checked")].map((box) => box.value);
  if (!what.length) return help.tell(t("calibrate.nothing"), false);
  const answer = await post({ do: "begin", what });
  if (answer.done) $("lead-word").focus();
}

async function post(body) {
  const answer = await help.post("/api/calibrate", body);
  help.tell(answer.text || t("told.refused"), answer.done);
  return answer;
}

/** A browser lets a page sound only after a person has pressed something. */
function listen() {
  sound ??= typeof AudioContext === "undefined" ? null : new AudioContext();
  sound?.resume?.();
}

function beep([hertz, seconds], after = 0) {
  if (!sound) return;
  const [tone, loud] = [sound.createOscillator(), sound.createGain()];
  tone.frequency.value = hertz;
  loud.gain.value = 0.3;
  tone.connect(loud).connect(sound.destination);
  tone.start(sound.currentTime + after);
  tone.stop(sound.currentTime + after + seconds);
}

/** Each second of the countdown, the moment from which the pose counts, and that it was taken. */
function beeps(before, message) {
  const pose = message.view?.zero_pose;
  if (before === "zero_pose" && message.view?.step !== "zero_pose" && heard.held) [0, 0.25].forEach((after) => beep(TAKEN, after));
  const second = pose ? Math.ceil(pose.countdown_s) : 0;
  if (second && second !== heard.second) beep(TICK);
  if (pose && !second && heard.second && !pose.waits) beep(NOW);
  heard = { second, held: pose?.held_s ?? 0 };
}

function show() {
  const may = document.body.dataset.may === "true";
  const led = Boolean(shown?.under_way);
  const step = led ? shown.view : null;
  for (const id of ["lead-word", "lead-end"]) $(id).hidden = !led;
  $("lead-word").disabled = $("lead-end").disabled = !may || Boolean(shown?.computing);
  $("lead-begin").hidden = $("lead-what").hidden = led;
  $("lead-begin").disabled = !may || !setup?.calibrates;
  $("lead-of").textContent = step && !shown.computing ? t("calibrate.of", { number: Math.min(step.number, step.steps), steps: step.steps }) : "";
  say("lead-title", title(step));
  say("lead-todo", todo(step));
  if (step) $("lead-word-word").textContent = t(wordKey(step));
  meter(step);
  outcome();
  nodes(step);
}

function wordKey(step) {
  if (step.step !== "zero_pose") return sure ? "calibrate.skip.sure" : "calibrate.skip";
  return step.zero_pose.waits ? "calibrate.ready" : step.zero_pose.countdown_s > 0 ? "calibrate.call_off" : "calibrate.go_on_standing";
}

function title(step) {
  if (shown?.computing && shown.under_way) return t("calibrate.computing");
  if (shown?.under_way) return t(step ? `calibrate.step.${step.step}` : "calibrate.starts");
  if (shown?.error) return t("calibrate.ended");
  if (shown?.outcome) return t("calibrate.result");
  return t(setup && !setup.calibrates ? "calibrate.cannot" : "calibrate.idle");
}

function todo(step) {
  if (shown?.under_way) return step && !shown.computing ? t(`calibrate.todo.${step.step}`, step.places) : "";
  if (shown?.error) return shown.error;
  if (!shown?.outcome) return t(setup && !setup.calibrates ? "calibrate.cannot.do" : "calibrate.idle.do");
  const { folder, to_name } = shown.outcome;
  const names = to_name.map((name) => nameOf(name)).join(", ");
  return t(to_name.length ? "calibrate.name" : "calibrate.restart", { folder, names });
}

/** Read aloud only where it changes. */
function say(id, words) {
  if ($(id).textContent === words) return;
  $(id).textContent = words;
  $("lead-said").textContent = `${$("lead-title").textContent} ${$("lead-todo").textContent}`;
}

function meter(step) {
  $("lead-meter").hidden = !step || Boolean(shown.computing);
  if ($("lead-meter").hidden) return;
  const pose = step.zero_pose;
  const counts = pose && pose.countdown_s > 0;
  $("lead-bar").value = pose ? pose.held_s / pose.wanted_s : step.share;
  const count = counts ? String(Math.ceil(pose.countdown_s)) : pose ? `${pose.held_s.toFixed(1)} / ${pose.wanted_s.toFixed(0)} s` : `${(100 * step.share).toFixed(0)} %`;
  $("lead-count").textContent = count;
  const moving = step.nodes.filter((node) => node.hint === "moves").length;
  const words = !pose ? "" : pose.waits ? "calibrate.pose.waits" : counts ? "calibrate.pose.counts" : moving ? "calibrate.pose.moves" : "calibrate.pose.still";
  $("lead-state").textContent = words && t(words, { count: moving });
}

function outcome() {
  const found = shown && !shown.under_way ? shown.outcome : null;
  const lines = found ? [...found.whole] : [];
  $("lead-outcome").replaceChildren(...lines.map((words) => make("li", words, { lang: "en", "data-level": "invalid" })));
}

const level = (node) => (node.hint === "silent" ? "silent" : node.share >= 1 ? "ok" : "attention");

/** Every sensor: on the figure by shape and colour, in the list in words, what wants most first. */
function nodes(step) {
  const found = shown && !shown.under_way ? shown.outcome : null;
  const rows = found
    ? Object.entries(found.nodes).map(([name, parts]) => result(name, parts))
    : (step?.nodes ?? []).map((node) => ({ name: node.name, share: node.share, level: level(node), words: t(`calibrate.hint.${node.hint}`, node.places) }));
  const order = ["silent", "invalid", "attention", "ok"];
  rows.sort((a, b) => order.indexOf(a.level) - order.indexOf(b.level) || a.share - b.share);
  figure?.show(new Map(rows.map((row) => [row.name, row.level])));
  const key = chosen() + JSON.stringify(rows);
  if (key === written) return;
  written = key;
  $("led-nodes").replaceChildren(...rows.map((row) => {
    const line = make("li", "", { "data-level": row.level, "data-node": row.name });
    line.append(make("b", nameOf(row.name)), make("span", row.words, row.language ? { lang: row.language } : {}));
    if (!found) line.append(make("progress", "", { max: 1, value: row.share, "aria-hidden": "true" }));
    return line;
  }));
}

/** What was written for a sensor and what was refused, why. */
function result(name, parts) {
  const refused = Object.entries(parts).filter(([, why]) => why);
  const done = Object.keys(parts).filter((part) => !parts[part]).map((part) => t(`calibrate.part.${part}`));
  const words = [done.length ? t("calibrate.written", { parts: done.join(", ") }) : "", ...refused.map(([part, why]) => `${t(`calibrate.part.${part}`)}: ${why}`)];
  return { name, share: 1, level: refused.length ? "invalid" : "ok", words: words.filter(Boolean).join("; "), language: refused.length ? "en" : "" };
}
