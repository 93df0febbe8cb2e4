// The robots that are there: who waits for an operator stands first; one press takes, opens or gives back.
import { make } from "./facts.js";
import { t } from "./words.js";

const MOST = 12;

/** What a line offers: to take a robot that nobody commands, to give back one's own. */
export function offers(row, operator) {
  if (row.namesakes || row.guard === null) return "";
  if (row.operator === operator && operator) return "release";
  return !row.operator || row.offered_to === operator ? "take" : "";
}

export function waits(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 90) return t("ago.s", { n: Math.round(seconds) });
  return seconds < 5400 ? t("ago.min", { n: Math.round(seconds / 60) }) : t("ago.h", { n: (seconds / 3600).toFixed(1) });
}

export class Fleet {
  /** `does`: open(robot), act(name, robot). Lines are drawn anew only where they changed, or a press would miss. */
  constructor(element, does) {
    this.element = element;
    this.does = does;
    this.drawn = "";
  }

  show(message, shown, operator, may) {
    const rows = (message.robots ?? []).filter((row) => row.robot !== shown || row.waits_s !== null).slice(0, MOST);
    this.element.hidden = rows.length === 0;
    const lines = rows.map((row) => ({
      ...row, waited: row.words ? `${waits(row.waits_s)}: ${row.words}` : waits(row.waits_s), offer: may ? offers(row, operator) : "",
    }));
    const key = JSON.stringify([lines.map((line) => [line.robot, line.guard, line.operator, line.waited, line.offer]), shown]);
    if (key === this.drawn || this.element.contains(document.activeElement)) return;
    this.drawn = key;
    this.element.replaceChildren(...lines.map((line) => this.line(line)));
  }

  line(row) {
    const item = make("li", "", row.waits_s === null ? {} : { "data-waits": "" });
    const said = row.waits_s === null ? row.operator || t("badge.free") : t("fleet.waits", { time: row.waited });
    item.append(make("b", row.robot), make("span", row.namesakes ? t("fleet.two") : said));
    const open = make("button", t("fleet.open"), { type: "button" });
    open.addEventListener("click", () => (open.blur(), this.does.open(row.robot)));
    item.append(open);
    if (row.offer) {
      const act = make("button", t(`fleet.${row.offer}`), { type: "button" });
      act.addEventListener("click", () => (act.blur(), this.does.act(row.offer, row.robot)));
      item.append(act);
    }
    return item;
  }
}
