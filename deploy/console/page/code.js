// A screen for a camera to look at: two codes of this console's time that are renewed in turn. While one of them
// changes, a camera exposes a blend of its old and new cells, which no reader accepts; the other one stands still.
import { ConsoleClock } from "./clock.js";
import { countOf, drawCode } from "./picture_code.js";

const PX = 8; // of a cell; the canvas is stretched to the window
const [WIDE, HIGH] = [12 * PX, 10 * PX];
const clock = new ConsoleClock().start();
const canvas = document.getElementById("codes");
const told = document.getElementById("told");
canvas.width = 2 * WIDE + 2 * PX;
canvas.height = HIGH;
const context = canvas.getContext("2d");
let turn = 0;

function frame(now_ms) {
  const here = clock.console(now_ms);
  if (here) {
    drawCode(context, countOf(here.at_ms), turn ? WIDE + 2 * PX : 0, 0, PX);
    turn = 1 - turn;
    const words = `${(here.at_ms / 1000).toFixed(0)} s ± ${here.bound_ms.toFixed(1)} ms`;
    if (told.textContent !== words) told.textContent = words;
  } else told.textContent = "the console's clock is not known yet";
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
