// The page's line to the console: one WebSocket, its acknowledgements, and the requests that are sent by POST.
// A frame is acknowledged soon after it was handed over: a page that stands still acknowledges nothing, is sent
// nothing, and so it never replays the past.

import { Pictures } from "./video.js";

const ACKNOWLEDGE_MS = 15;
const BEAT_MS = 50; // the held deadman
const LOOK_MS = 250;
const SILENT_LOOKS = 8; // a socket that says nothing for so many looks is opened anew
const RETRY_MS = 300; // a stop that nobody has confirmed yet

const json = { "Content-Type": "application/json" };

export class Link {
  /** `heard` has functions by kind: hello, view, facts, picture, answer, bye. */
  constructor(heard, robot) {
    this.heard = heard;
    this.robot = robot;
    this.lastFrame_ms = null;
    this.processed = 0;
    this.acknowledged = 0;
    this.drawnView = 0;
    this.failures = 0;
    this.socket = null;
    this.quiet = false; // nothing is sent to a page that may not look
    this.beat = null;
    this.stopping = null;
    const keyframe = (camera) => this.send({ kind: "keyframe", camera });
    this.pictures = new Pictures(keyframe, () => this.heard.undecodable?.());
    this.open();
    setInterval(() => this.watch(), LOOK_MS);
  }

  open() {
    const query = this.robot ? `?robot=${encodeURIComponent(this.robot)}` : "";
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws${query}`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.processed = this.acknowledged = this.drawnView = 0;
    this.pictures.clear();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.failures = 0;
      if (typeof event.data === "string") this.message(JSON.parse(event.data));
      else this.picture(event.data);
    };
    socket.onclose = (event) => {
      if (socket !== this.socket) return;
      this.socket = null;
      const wait_ms = event.code === 1013 ? 5000 : Math.min(1000, 100 * 2 ** this.failures++);
      setTimeout(() => this.socket ?? this.open(), wait_ms);
    };
  }

  /** Close and open again, as after a log-in. */
  reopen() {
    const old = this.socket;
    this.open();
    old?.close();
  }

  /** Counts looks, not time: after a pause of the page the looks come before the messages that wait. */
  watch() {
    const heard = this.lastFrame_ms !== this.looked_ms;
    this.looked_ms = this.lastFrame_ms;
    this.silentLooks = heard || this.quiet || document.hidden ? 0 : (this.silentLooks ?? 0) + 1;
    if (this.socket && this.silentLooks >= SILENT_LOOKS) {
      this.silentLooks = 0;
      this.reopen();
    }
  }

  message(message) {
    this.lastFrame_ms = performance.now();
    if (message.kind === "view") this.drawnView = message.n;
    this.heard[message.kind]?.(message);
    if (message.n) this.acknowledge(message.n);
  }

  async picture(data) {
    this.lastFrame_ms = performance.now();
    const length = new DataView(data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const arrived_ms = performance.now();
    try {
      await this.pictures.take({ ...header, arrived_ms }, new Uint8Array(data, 4 + length), (shown) => this.heard.picture?.(shown));
    } catch {
      this.heard.broken?.(header);
    }
    this.acknowledge(header.n);
  }

  acknowledge(n) {
    const waits = this.processed > this.acknowledged;
    this.processed = Math.max(this.processed, n);
    if (waits) return;
    const socket = this.socket;
    // not at the next drawn frame: where drawing is slow, the page would starve of news
    setTimeout(() => {
      if (socket !== this.socket) return;
      this.acknowledged = this.processed;
      this.send({ kind: "ack", n: this.processed });
    }, ACKNOWLEDGE_MS);
  }

  /** Whether it was handed to an open socket; not whether anybody received it. */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /**
   * Ask for the stop, by the socket and by a request that survives the page, until the console has confirmed.
   *
   * Without a robot's name the console takes the one that this page shows, or its first.
   */
  stop(robot, told) {
    clearTimeout(this.stopping?.timer);
    const stopping = { sent: false, timer: null };
    this.stopping = stopping;
    const tell = (sent) => {
      if (this.stopping !== stopping || stopping.sent) return;
      stopping.sent = sent;
      if (sent) clearTimeout(stopping.timer);
      told(sent);
    };
    const attempt = () => {
      if (stopping.sent || this.stopping !== stopping) return;
      this.send({ kind: "stop", robot });
      fetch("/api/stop", { method: "POST", keepalive: true, headers: json, body: JSON.stringify({ robot }) })
        .then((response) => tell(response.status === 202))
        .catch(() => tell(false));
      stopping.timer = setTimeout(attempt, RETRY_MS);
    };
    attempt();
    return () => tell(true);
  }

  /** Hold the deadman, or let it go. A beat quotes the newest view, so that a page that froze does not hold. */
  hold(down) {
    if (down === Boolean(this.beat)) return;
    const say = () => this.send({ kind: "held", n: this.drawnView, down });
    clearInterval(this.beat);
    this.beat = down ? setInterval(say, BEAT_MS) : null;
    say();
  }

  /** Let the deadman go, and say so whether or not it was held: a page that comes back must not go on holding. */
  letGo() {
    clearInterval(this.beat);
    this.beat = null;
    this.send({ kind: "held", n: this.drawnView, down: false });
  }

  /** What a person asks of the robot: {done, text, status}. */
  async act(act, robot, more = {}) {
    return this.post("/api/act", { act, robot, ...more });
  }

  async post(path, body) {
    try {
      const response = await fetch(path, { method: "POST", headers: json, body: JSON.stringify(body) });
      const answer = await response.json().catch(() => ({}));
      const text = answer.text ?? answer.error ?? "";
      return { ...answer, done: response.ok && answer.done !== false, text, status: response.status };
    } catch {
      return { done: false, text: "", status: 0 };
    }
  }
}

/** What does not change while the console runs; asked each second until it is known. */
export async function setup(robot) {
  for (;;) {
    try {
      const response = await fetch(`/api/setup${robot ? `?robot=${encodeURIComponent(robot)}` : ""}`);
      if (response.ok) return await response.json();
    } catch {
      // the console does not answer: the banner says so already
    }
    await new Promise((resolve) => setTimeout(resolve, 1000));
  }
}
