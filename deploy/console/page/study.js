// The study's page: the protocol's step, its questionnaire, and the reports that lie on this host.
import { make } from "./facts.js";
import { chosen, t } from "./words.js";

const $ = (id) => document.getElementById(id);
let asked = {}; // the questionnaires, by name
let study = null;
let shown = ""; // which form stands there: step and questionnaire
let heard_ms = 0;
let post = async () => ({ done: false });

/** `help`: {post, tell} of the page. */
export function wire(help) {
  post = async (body) => {
    const answer = await help.post("/api/study", body);
    help.tell(answer.text || t("told.refused"), answer.done);
    return answer;
  };
  $("step-next").addEventListener("click", () => post({ do: "next" }));
  $("step-end").addEventListener("click", (event) => {
    const button = event.currentTarget;
    if (button.dataset.sure) post({ do: "end" });
    button.dataset.sure = button.dataset.sure ? "" : "1";
    button.textContent = t(button.dataset.sure ? "step.end.sure" : "step.end");
  });
  $("questions").addEventListener("submit", send);
  setInterval(left, 500);
}

export async function prepare() {
  for (const path of ["/api/questionnaires", "/api/reports"]) {
    const answer = await fetch(path).catch(() => null);
    if (!answer?.ok) continue;
    if (path.endsWith("reports")) reports((await answer.json()).reports);
    else asked = await answer.json();
  }
  show();
}

export const speak = () => ((shown = ""), show());

export function view() {}

export function facts(message) {
  study = message.study ?? null;
  heard_ms = performance.now();
  show();
}

/** Words in the reader's language; where there are none, in the other. */
const said = (words) => words?.[chosen()] ?? Object.values(words ?? {})[0] ?? "";

function show(may = document.body.dataset.may === "true") {
  $("step-none").hidden = Boolean(study);
  $("step-of").textContent = study ? `${study.subject} · ${study.session} · ${study.done} / ${study.steps}` : "";
  $("step-name").textContent = study?.step?.name ?? "";
  $("step-text").textContent = said(study?.step?.text);
  $("step-next").disabled = !may || !study?.next;
  $("step-next-word").textContent = study?.next ? t("step.next", { step: study.next.name }) : t("step.last");
  $("step-end").disabled = !may || !study;
  left();
  form(may);
}

/** How much of the step's time is left; a step without one counts up. */
function left() {
  if (!study?.step || study.since_s === null) return void ($("step-left").textContent = "");
  const since_s = study.since_s + (performance.now() - heard_ms) / 1000;
  const rest_s = study.step.seconds === null ? since_s : study.step.seconds - since_s;
  $("step-left").textContent = t(study.step.seconds === null ? "step.since" : rest_s > 0 ? "step.left" : "step.over", { seconds: Math.abs(rest_s).toFixed(0) });
}

function form(may) {
  const name = study?.step?.questionnaire ?? "";
  const done = Boolean(name) && study.answered.some(([step, which]) => step === study.step.name && which === name);
  const key = `${study?.session}/${study?.step?.name}/${name}/${done}/${may}/${chosen()}`;
  if (key === shown || (name && !asked[name])) return;
  shown = key;
  const found = asked[name];
  $("form-title").textContent = found ? said(found.title) : t("form");
  $("form-source").textContent = found && !done ? found.source : "";
  if (!found || done) return $("questions").replaceChildren(make("p", t(done ? "form.kept" : "form.none")));
  const send = make("button", t("form.send"), { type: "submit" });
  send.disabled = !may;
  $("questions").replaceChildren(...found.item.map((item) => question(found, item)), send);
}

/** One item: a scale with few numbers as buttons, with many as a slider that must be moved once. */
function question(found, item) {
  const field = make("fieldset", "", { "data-item": item.id });
  field.append(make("legend", said(item.text)), make("span", said(item.low), { class: "end" }));
  if ((found.highest - found.lowest) / found.step <= 10) {
    for (let value = found.lowest; value <= found.highest; value += found.step) {
      const label = make("label", "", {});
      label.append(make("input", "", { type: "radio", name: item.id, value, required: "" }), make("span", String(value)));
      field.append(label);
    }
  } else {
    const slider = make("input", "", {
      type: "range", name: item.id, min: found.lowest, max: found.highest, step: found.step, "aria-label": said(item.text),
      value: (found.highest + found.lowest) / 2,
    });
    const value = make("output", "?");
    slider.addEventListener("input", () => ((value.textContent = slider.value), (field.dataset.answered = "1")));
    field.append(slider, value);
  }
  field.append(make("span", said(item.high), { class: "end" }));
  return field;
}

async function send(event) {
  event.preventDefault();
  const name = study?.step?.questionnaire;
  const given = new FormData($("questions"));
  const missing = asked[name].item.find(({ id }) => {
    const field = $("questions").querySelector(`[data-item="${id}"]`);
    return field.querySelector("[type=range]") ? !field.dataset.answered : !given.has(id);
  });
  for (const field of $("questions").querySelectorAll("fieldset")) field.classList.toggle("missing", field.dataset.item === missing?.id);
  if (missing) return $("questions").querySelector(`[data-item="${missing.id}"] input`).focus();
  const answers = Object.fromEntries([...given].map(([id, value]) => [id, Number(value)]));
  await post({ do: "answers", questionnaire: name, answers });
}

function reports(found) {
  $("report-list").replaceChildren(...found.map(({ name, path, words }) => {
    const line = make("li");
    line.append(make("a", name, { href: path, target: "_blank", rel: "noopener" }), make("span", ` ${words}`, { lang: "en" }));
    return line;
  }));
  if (!found.length) $("report-list").replaceChildren(make("li", t("reports.none")));
}
