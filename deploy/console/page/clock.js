// This page's clock against the console's: of the exchanges of the last minute, the quickest one counts.

const KEPT_MS = 60000;
const ASK_MS = 2000;
const RESOLUTION_MS = 0.1; // of performance.now() in a page that is not isolated

export class ConsoleClock {
  constructor() {
    this.exchanges = [];
  }

  /** Ask now and every two seconds; a hidden page asks nothing. */
  start() {
    const ask = () => document.hidden || this.ask();
    for (let i = 0; i < 4; i++) setTimeout(ask, 100 * i); // the first one opens the connection, and is slow
    setInterval(ask, ASK_MS);
    return this;
  }

  async ask() {
    const asked_ms = performance.now();
    try {
      const response = await fetch("/api/clock", { cache: "no-store" });
      const heard_ms = performance.now();
      if (response.ok) this.take(asked_ms, (await response.json()).here_ms, heard_ms);
    } catch {
      // the console does not answer: the newest exchange grows old by itself
    }
  }

  /** Asked at `asked_ms` and heard at `heard_ms` of this page; meanwhile the console's clock said `here_ms`. */
  take(asked_ms, here_ms, heard_ms) {
    const way_ms = heard_ms - asked_ms;
    if (!(way_ms >= 0) || !Number.isFinite(here_ms)) return;
    this.exchanges = this.exchanges.filter((each) => heard_ms - each.heard_ms < KEPT_MS);
    this.exchanges.push({ heard_ms, off_ms: here_ms - (asked_ms + heard_ms) / 2, bound_ms: way_ms / 2 + RESOLUTION_MS });
  }

  /** {at_ms, bound_ms} of the console's clock at a time of this page; null before the first exchange. */
  console(page_ms) {
    if (!this.exchanges.length) return null;
    const best = this.exchanges.reduce((a, b) => (b.bound_ms < a.bound_ms ? b : a));
    return { at_ms: page_ms + best.off_ms, bound_ms: best.bound_ms };
  }
}
