// The page: hears the console, shows one state, and asks for the stop. The stop is wired first, before anything else.
import { Link, setup as askSetup } from "./link.js";
import { badges, confirms, joints_off, situation, stopLights } from "./state.js";
import { choose, chosen, LANGUAGES, load, nameOf, other, t, translate } from "./words.js";
import {
  attention, BodyFigure, Events, JointTable, latencyNow, link as linkFacts, make, Minute, shape,
} from "./facts.js";
import { Cameras } from "./cameras.js";
import { foretold } from "./ahead.js";
import { Fleet } from "./fleet.js";
import { Glass, worst } from "./glass.js";

const $ = (id) => document.getElementById(id);
const ENGAGE_MS = 1000;
const OFF_DEG = 5;
const engineer = document.body.dataset.page === "engineer";
const MORE = { engineer: "./engineer.js", study: "./study.js", calibrate: "./calibrate.js" };
const seen = { hello: null, view: null, facts: null, setup: null, opened_ms: performance.now(), stopAsked: null, holdKey: "F9" };
const parts = {};
// the one that is on the screen; before there is any, the one that was asked for and not one in its place
const robotOf = () => seen.view?.robot ?? link.robot ?? seen.hello?.robot ?? seen.setup?.robot ?? undefined;

// ---- stop: first, so that nothing that fails below can take it away

const link = new Link({
  hello, view, facts, fleet, picture: gotPicture,
  calibration: (message) => ((seen.calibration = message), parts.more?.calibration?.(message)),
  answer: (answer) => (answer.to === "stop" ? answer.done && stopConfirmed() : tell(answer.text, answer.done)),
  stop: ({ stop: told }) => ((seen.stop = told), showStop()), // to a page that is shown nothing else
  bye: (bye) => tell(bye.why, false),
  undecodable: () => link.send({ kind: "jpeg" }), // the console makes JPEG of it, or says why it cannot
}, new URLSearchParams(location.search).get("robot"));
let stopConfirmed = () => {};
const glass = new Glass(link);

function stop(event) {
  event?.preventDefault();
  if (seen.setup?.replay) return;
  seen.stopAsked = "sending";
  seen.stopped_ms = performance.now();
  stopConfirmed = link.stop(robotOf(), (sent) => {
    seen.stopAsked = sent ? "sent" : "not_sent";
    showStop();
  });
  showStop();
}
$("stop").addEventListener("pointerdown", stop);
$("stop").addEventListener("click", (event) => event.detail === 0 && stop(event)); // a screen reader's press
addEventListener("keydown", keyDown, { capture: true });
addEventListener("keyup", keyUp, { capture: true });

const KEYS = {
  F2: { down: (event) => engaging(true, event.shiftKey), up: () => engaging(false) },
  F3: { down: () => act("disengage") },
  F4: { down: mark },
  F6: { down: fullScreen },
  F7: { down: changeLanguage },
  F8: { down: () => parts.more?.word?.() },
};

function keyDown(event) {
  const writes = event.target instanceof HTMLInputElement;
  const chooses = event.target instanceof HTMLSelectElement;
  if (event.key === "Escape" || (event.key === " " && !writes)) {
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) stop();
    return;
  }
  if (event.key === seen.holdKey && mayHold()) {
    event.preventDefault();
    seen.heldCode = event.code;
    if (!event.repeat) hold(true);
    return;
  }
  const plain = !writes && !chooses && !event.shiftKey && !event.ctrlKey && !event.altKey && !event.metaKey;
  if (plain && /^[1-9]$/.test(event.key)) parts.cameras?.chooseAt(Number(event.key) - 1);
  if (!KEYS[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  if (!event.repeat) KEYS[event.key].down(event);
}

function keyUp(event) {
  if (event.key === " ") event.preventDefault();
  // the key's place too: with Shift or another layout it has another name when it comes up
  if (event.key === seen.holdKey || (event.code && event.code === seen.heldCode)) hold(false);
  KEYS[event.key]?.up?.();
}

// ---- what a helper asks for

let engage = null;

/** The request is made after a second of holding, whether or not a frame could be drawn meanwhile. */
function engaging(down, together = false) {
  clearTimeout(engage);
  engage = null;
  $("engage").classList.toggle("down", down && Boolean(seen.hello?.may?.act));
  if (!down) return;
  if (seen.hello?.may?.act) engage = setTimeout(() => (blind() ? tell(t("told.no_contact"), false) : act("engage", { together })), ENGAGE_MS);
  else tell(t("may.not"), false);
}

const blind = () => situation(now()).id === "no_contact";

async function act(name, more = {}, robot = robotOf()) {
  if (!seen.hello?.may?.act && name !== "reset") return tell(t("may.not"), false);
  const answer = await link.act(name, robot, more);
  tell(answer.text || t(answer.done ? "told.done" : `told.${answer.status}`, { status: answer.status }), answer.done);
  return answer;
}

function mark() {
  return act("mark", { text: new Date().toISOString() });
}

const mayHold = () => seen.setup?.deadman === "console" && seen.hello?.may?.hold !== false;

function hold(down) {
  link.hold(down && mayHold());
  $("hold").classList.toggle("down", down);
}

function fullScreen() {
  parts.leaves = Boolean(document.fullscreenElement);
  if (parts.leaves) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().then(() => navigator.keyboard?.lock?.(["Escape"])).catch(() => {});
}

/** A browser may keep Esc to itself in full screen: whatever ended it but F6 is taken for Esc, and stops. */
function leftFullScreen() {
  if (!document.fullscreenElement && !parts.leaves) stop();
  parts.leaves = false;
}

function tell(words, done) {
  $("told").textContent = words ?? "";
  $("told").dataset.done = done;
  clearTimeout(parts.told);
  parts.told = setTimeout(() => ($("told").textContent = ""), 12000);
}

/** The sheet for a reset key or a token: never over the stop button, and never in the way of its keys. */
function openSheet(kind) {
  parts.sheet = kind;
  $("sheet-title").textContent = t(`sheet.${kind}`);
  $("sheet-label").textContent = t(`sheet.${kind}.label`);
  $("sheet-send").textContent = t(`sheet.${kind}.send`);
  $("sheet-note").textContent = "";
  $("sheet-field").value = "";
  $("sheet").hidden = false;
  $("sheet-field").focus();
}

async function sendSheet(event) {
  event.preventDefault();
  const secret = $("sheet-field").value.trim();
  const answer = parts.sheet === "reset" ? await act("reset", { key: secret }) : await login(secret);
  if (answer?.done) $("sheet").hidden = true;
  else $("sheet-note").textContent = answer?.text || t("told.refused");
}

async function login(token) {
  const answer = await link.post("/api/login", { token });
  if (answer.done) link.reopen();
  return answer;
}

// ---- what is heard

async function hello(message) {
  const other_console = parts.session && parts.session !== message.session;
  const other_robot = seen.setup && seen.setup.robot !== message.robot;
  parts.session = message.session;
  seen.hello = message;
  seen.stop = null;
  const turned = parts.shows !== undefined && parts.shows !== message.robot;
  parts.shows = message.robot;
  if (turned) {
    link.pictures.clear();
    parts.cameras?.clear(); // the home of one patient must not stand under the name of another
  }
  if (turned || message.role === "nobody") seen.view = seen.facts = null;
  link.quiet = message.role === "nobody";
  $("hold").classList.remove("down");
  if (message.may?.hold) link.letGo();
  show();
  if (link.quiet) return;
  looks(parts.cameras?.large);
  if (!seen.setup || other_console || other_robot) await prepare(message.robot);
}

async function prepare(robot) {
  if (parts.preparing === robot) return;
  parts.preparing = robot;
  const found = await askSetup(robot);
  parts.preparing = null;
  const same = seen.setup?.robot === found.robot;
  seen.setup = found;
  seen.holdKey = found.deadman_key ?? "F9";
  document.body.classList.toggle("replay", Boolean(found.replay));
  if (!parts.spoken) speak(localStorage.getItem("language") ?? found.language);
  $("robot").replaceChildren(...found.robots.map((name) => make("option", name, { value: name })));
  $("robot").value = found.robot;
  $("hold").hidden = found.deadman !== "console";
  $("hold-key").textContent = seen.holdKey;
  parts.figure = found.nodes?.length && $("figure") ? new BodyFigure($("figure"), found.nodes) : null;
  parts.table = $("joints") ? new JointTable($("joints"), found.joints, engineer) : null;
  if (!same) parts.cameras = $("cameras") ? new Cameras($("cameras"), found.cameras ?? [], looks) : null;
  cameras(Object.keys(seen.view?.video ?? {}));
  if (parts.more) parts.more.prepare(found);
  if (seen.facts) facts(seen.facts);
  await threeD(found);
}

async function threeD(found) {
  if (!$("scene")) return;
  try {
    const { RobotView } = await import("./robot.js");
    parts.robot = new RobotView($("scene"), found);
    if (seen.view) parts.robot.show(seen.view);
  } catch (error) {
    $("scene").replaceChildren(make("p", t("scene.none", { error: error.message })));
  }
}

function view(message) {
  seen.view = message;
  if (message.guard !== "estop" && !message.stop && performance.now() - (seen.stopped_ms ?? 0) > 3000) {
    if (seen.stopAsked === "sent") seen.stopAsked = null;
  }
  if (seen.stopAsked && confirms(message.stop, (performance.now() - seen.stopped_ms) / 1000)) stopConfirmed();
  const known = seen.setup && message.encoder?.length === seen.setup.joints.length;
  if (known && message.heard !== "none") {
    parts.robot?.show(message);
    if ($("joints") && !$("joints").hidden) parts.table?.show(message, { ...seen.facts?.drives, effort_nm: seen.facts?.effort_nm });
    const off = joints_off(message, OFF_DEG).slice(0, 3);
    const held = (joint) => (message.limited?.includes(joint) ? ` (${t("limited")})` : "");
    if ($("off")) $("off").textContent = off.map(({ joint, off_deg }) => t("off", { joint: nameOf(seen.setup.joints[joint].name), degrees: off_deg.toFixed(0) }) + held(joint)).join(" · ");
  }
  cameras(Object.keys(message.video ?? {}));
  parts.cameras?.foretell(seen.facts?.lenses, seen.setup?.links, known ? foretold(message, seen.setup.links) : null);
  latencyNow(message.latency);
  parts.more?.view(message);
  show();
}

function openRobot(robot) {
  hold(false);
  link.robot = robot;
  link.send({ kind: "robot", robot });
}

function fleet(message) {
  parts.fleet ??= $("fleet") && new Fleet($("fleet"), { open: openRobot, act: (name, robot) => act(name, {}, robot) });
  parts.fleet?.show(message, robotOf(), seen.setup?.operator, Boolean(seen.hello?.may?.act));
}

function facts(message) {
  seen.facts = message;
  linkFacts(message);
  if ($("nodes")) attention(message, parts.figure);
  parts.events?.show(message.events ?? []);
  if (message.latency?.minute) parts.minute?.show(message.latency.minute);
  const foretold = message.ahead;
  const figures = foretold && { ms: foretold.ahead_ms.toFixed(0), rms: foretold.rms_deg.toFixed(1), held: foretold.held_rms_deg.toFixed(1), inside: foretold.inside_percent.toFixed(0) };
  if ($("scene")) $("scene").title = figures ? t("ahead.score", figures) : "";
  const eye = worst(message.glass);
  put($("glass"), eye ? t("picture.glass", { ms: eye.ms.toFixed(0), bound: Math.ceil(eye.bound_ms) }) : "");
  parts.more?.facts(message);
}

/** Cameras that are heard of later get their place too. */
function cameras(names) {
  parts.cameras?.add(names);
}

/** The console sends all pictures of the camera that is shown large, fewer of the others; none where none is shown. */
function looks(camera) {
  if (camera || !$("cameras")) link.send({ kind: "look", camera: camera ?? null });
}

function gotPicture(header) {
  cameras([header.camera]);
  const shown = parts.cameras?.take(header);
  if (shown) glass.drawn(header.camera, header.number, shown);
  showPictures();
}

// ---- what is shown

const now = () => ({
  ...seen,
  doubt: seen.facts?.doubt,
  open: link.socket !== null,
  sinceFrame_s: link.lastFrame_ms === null ? null : (performance.now() - link.lastFrame_ms) / 1000,
  sinceOpen_s: (performance.now() - seen.opened_ms) / 1000,
});

function put(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}

function show() {
  const found = situation(now());
  const words = t(`state.${found.id}`, found.places);
  const places = { ...found.places, doubt: seen.facts?.doubt ?? "", key: seen.holdKey };
  if (document.body.dataset.state !== found.id || !$("shape").firstChild) {
    document.body.dataset.state = found.id;
    $("shape").replaceChildren(shape(found.id));
    // read aloud: the state alone, and only when it changes
    $("said").textContent = `${words}. ${t(found.act, places)}`;
  }
  put($("word"), words);
  showWhy(found);
  put($("todo"), t(found.act, places));
  const title = `${words} · ${robotOf() || "tandem"}`;
  if (document.title !== title) document.title = title;
  showBadges();
  showStop(found.id);
  const may = Boolean(seen.hello?.may?.act) && found.id !== "no_contact";
  document.body.dataset.may = may;
  for (const id of ["engage", "disengage", "mark"]) $(id).disabled = !may;
  $("reset").hidden = found.id === "no_contact" || seen.view?.guard !== "estop" || !seen.hello?.may?.reset;
  $("login").hidden = found.id === "no_contact" || Boolean(seen.hello?.may?.act) || !seen.hello;
}

/** The robot's own words are English: in another language, what the state means stands before them. */
function showWhy(found) {
  const own = chosen() === "en" && found.why ? "" : t(`why.${found.id}`, found.places);
  const [meaning, words] = $("why").children;
  put(meaning, own + (own && found.why ? " " : ""));
  put(words, found.why);
}

function showBadges() {
  const found = badges(now());
  const key = chosen() + JSON.stringify(found);
  if (key === parts.badges) return;
  parts.badges = key;
  $("badges").replaceChildren(...found.map(({ id, places, groups }) => {
    const item = make("li", "", { "data-tone": id, title: t(`badge.${id}.why`) });
    const words = groups ? { groups: groups.map(nameOf).join(", ") } : places;
    item.append(shape(id), make("span", t(`badge.${id}`, words)));
    return item;
  }));
}

function showStop(id = situation(now()).id) {
  const found = stopLights(id, seen.view ?? { stop: seen.stop }, seen.stopAsked);
  $("stop").classList.toggle("dead", found.dead || Boolean(seen.setup?.replay));
  put($("stop-word"), t(seen.setup?.hardware_estop ? "stop.hardware" : "stop"));
  const others = LANGUAGES[1 - LANGUAGES.indexOf(chosen())];
  put($("stop-other"), t(seen.setup?.hardware_estop ? "stop.hardware" : "stop", {}, others));
  $("stop-other").lang = others === "zh" ? "zh-Hans" : others;
  const note = seen.setup?.replay ? "stop.replay" : found.failed ? `stop.${found.failed}` : "stop.keys";
  put($("stop-note"), t(note, { words: found.words }));
  const list = $("lights");
  if (!list.children.length) {
    for (const { id } of found.lights) {
      list.append(make("li", "", { "data-light": id }));
      list.lastChild.append(make("span"), make("b"));
    }
  }
  found.lights.forEach((light, i) => {
    list.children[i].classList.toggle("on", light.on);
    const when = light.on && light.at_s !== null && light.id !== "asked" ? `${light.at_s.toFixed(2)} s` : "";
    put(list.children[i].firstChild, t(`light.${light.id}`));
    put(list.children[i].lastChild, when);
  });
}

function showPictures() {
  parts.cameras?.tick($("home-age"), seen.view?.page_ms, seen.setup?.stale_picture_s ?? 0.5);
}

// ---- languages, and the start

function speak(language) {
  choose(language);
  parts.spoken = true;
  parts.badges = "";
  translate();
  $("language-word").textContent = t("language.name", {}, other());
  $("language-word").lang = other() === "zh" ? "zh-Hans" : other();
  if (seen.setup && $("joints")) parts.table = new JointTable($("joints"), seen.setup.joints, engineer);
  parts.cameras?.speak();
  parts.more?.speak?.(seen.setup);
  if (seen.facts) facts(seen.facts);
  show();
}

function changeLanguage() {
  localStorage.setItem("language", other());
  speak(other());
}

function wire() {
  const press = (id, does) => $(id)?.addEventListener("click", does);
  press("disengage", () => act("disengage"));
  press("mark", mark);
  press("full", fullScreen);
  press("language", changeLanguage);
  press("reset", () => openSheet("reset"));
  press("login", () => openSheet("login"));
  press("sheet-close", () => ($("sheet").hidden = true));
  $("sheet").addEventListener("submit", sendSheet);
  const held = (id, does) => {
    $(id).addEventListener("pointerdown", (event) => does(event.isPrimary, event.shiftKey));
    for (const end of ["pointerup", "pointerleave", "pointercancel"]) $(id).addEventListener(end, () => does(false));
  };
  held("engage", engaging);
  held("hold", hold);
  $("engage").addEventListener("keydown", (event) => event.key === "Enter" && !event.repeat && engaging(true, event.shiftKey));
  $("engage").addEventListener("keyup", (event) => event.key === "Enter" && engaging(false));
  const toggle = (id, does) => press(id, () => {
    const on = $(id).getAttribute("aria-pressed") !== "true";
    $(id).setAttribute("aria-pressed", on);
    does(on);
  });
  if ($("show-zones")) toggle("show-zones", (on) => parts.robot?.showZones(on));
  if ($("show-joints")) toggle("show-joints", (on) => {
    $("joints").hidden = !on;
    if (on && seen.view && seen.setup) parts.table?.show(seen.view);
  });
  $("robot").addEventListener("change", () => openRobot($("robot").value));
  document.addEventListener("fullscreenchange", leftFullScreen);
  addEventListener("blur", () => (hold(false), engaging(false)));
  document.addEventListener("visibilitychange", () => document.hidden && (hold(false), engaging(false)));
}

async function start() {
  wire();
  if ($("events")) parts.events = new Events($("events"));
  setInterval(() => (show(), showPictures()), 100);
  setInterval(() => parts.events?.tick(), 1000);
  await load();
  speak(localStorage.getItem("language") ?? navigator.language.slice(0, 2));
  parts.spoken = Boolean(localStorage.getItem("language"));
  if (MORE[document.body.dataset.page]) {
    parts.more = await import(MORE[document.body.dataset.page]);
    parts.more.wire?.({ post: (path, body) => link.post(path, body), tell });
    if (seen.setup) parts.more.prepare(seen.setup);
    if (seen.calibration) parts.more.calibration?.(seen.calibration);
  }
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    history.replaceState(null, "", location.pathname + location.search);
    const answer = await login(token);
    if (!answer.done) tell(answer.text || t("told.refused"), false);
  }
  const { default: Plot } = await import("/vendor/uplot.js");
  if ($("late-minute")) parts.minute = new Minute($("late-minute"), Plot);
  if (seen.facts) facts(seen.facts);
}

start();
