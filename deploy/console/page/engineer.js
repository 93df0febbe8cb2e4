// The engineer's page: the guard's table, the stages of the latency, joints and drives, suit, counters.
import { make } from "./facts.js";
import { nameOf, t } from "./words.js";

const $ = (id) => document.getElementById(id);
const fixed = (value, digits = 1) => (typeof value === "number" ? value.toFixed(digits) : "–");
let setup = null;
let guard = "";

export function prepare(found) {
  setup = found;
  guard = "";
  $("guard-states").replaceChildren(...(found.guard_states ?? []).map((state) => make("li", state, { "data-guard": state })));
}

export const speak = (found) => found && prepare(found);

/** Where the guard is, and the ways that lead on from there. */
export function view(message) {
  if (!setup || guard === message.guard) return;
  guard = message.guard;
  for (const state of $("guard-states").children) {
    if (state.dataset.guard === guard) state.setAttribute("aria-current", "true");
    else state.removeAttribute("aria-current");
  }
  const ways = (setup.transitions ?? []).filter(([from]) => from === guard);
  $("guard-ways").replaceChildren(...ways.map(([, event, to]) => {
    const way = make("li", "", { lang: "en" });
    way.append(make("span", event), make("b", ` → ${to}`));
    return way;
  }));
}

export function facts(message) {
  stages(message.latency?.stages ?? []);
  nodes(message.nodes ?? []);
  $("counters").replaceChildren(rows(flattened(message)));
  $("guard-times").textContent = message.guard_times ?? message.link?.why ?? "";
}

function stages(found) {
  const table = rows([]);
  table.append(header(["column.stage", "column.mean", "column.p99"]));
  const most = Math.max(1e-9, ...found.map((stage) => stage.mean_ms ?? 0));
  for (const stage of found) {
    const row = make("tr");
    const bar = make("span", "", { class: "bar" });
    bar.style.width = `${(100 * (stage.mean_ms ?? 0)) / most}%`;
    const name = make("td", stage.name.replaceAll("→", "→\u200b"), { lang: "en" });
    name.append(bar);
    const number = (ms) => make("td", fixed(ms, 2), { class: "number" });
    row.append(name, number(stage.mean_ms), number(stage.p99_ms));
    table.append(row);
  }
  $("stage-table").replaceChildren(table);
}

function nodes(found) {
  const table = rows([]);
  table.append(header(["column.node", "column.level", "column.answered", "column.lost"]));
  for (const node of found) {
    const row = make("tr", "", { "data-level": node.level, title: node.words ?? "" });
    row.append(make("td", nameOf(node.name)), make("td", t(`level.${node.level}`)), make("td", fixed(node.answered_percent), { class: "number" }), make("td", String(node.lost ?? "–"), { class: "number" }));
    table.append(row);
  }
  $("node-table").replaceChildren(table);
}

function header(keys) {
  const row = make("tr");
  keys.forEach((key, i) => row.append(make("th", t(key), i && key !== "column.level" ? { class: "number" } : {})));
  return row;
}

const SHOWN = ["faults", "switches", "drives", "buses", "base", "camera", "recorder", "console", "versions", "viewers"];

/** What was told, key by key: ["drives.counters.writes", 15210]; lists of many numbers stand in the joint table. */
function flattened(message) {
  const found = [];
  const walk = (path, value) => {
    if (value === null || value === undefined || value === "") return;
    if (Array.isArray(value) && value.every((each) => typeof each !== "object" || each === null)) {
      if (value.length && value.length <= 4) found.push([path, value.join(", ")]);
    } else if (typeof value === "object") {
      for (const [key, inner] of Object.entries(value)) walk(path ? `${path}.${key}` : key, inner);
    } else found.push([path, typeof value === "number" && !Number.isInteger(value) ? value.toFixed(2) : String(value)]);
  };
  for (const key of SHOWN) walk(key, message[key]);
  return found;
}

function rows(pairs) {
  const table = make("table");
  for (const [name, value] of pairs) {
    const row = make("tr");
    row.append(make("th", name.replaceAll(".", " ▸ "), { scope: "row", lang: "en" }), make("td", value, { lang: "en" }));
    table.append(row);
  }
  return table;
}
