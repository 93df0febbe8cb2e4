// What the page shows, worked out of what it heard: no document, no clock, no line. All times in seconds.

export const NO_CONTACT_S = 0.5;
const OPENING_S = 2; // before the first message the page is starting, for so long at most

const SITUATIONS = {
  starting: "starting",
  silent: "no_robot",
  holds: "holds",
  aligns: "aligns",
  follows: "follows",
  stopped: "stopped",
  other_operator: "other",
  repositions: "clutch",
};

/**
 * The one state of the banner.
 *
 * `seen`: {sinceFrame_s (null: none yet), sinceOpen_s, open, hello, view, setup, doubt}. Answers {id, why, whyLanguage,
 * act, places}: `id` names word, colour and shape; `why` is the robot's own words; `act` is the key of what to do.
 */
export function situation(seen) {
  const { sinceFrame_s, sinceOpen_s, hello, view, setup } = seen;
  if (hello?.role === "nobody" && seen.open) return plain("locked");
  const known = sinceFrame_s !== null;
  if (known ? sinceFrame_s > NO_CONTACT_S : sinceOpen_s > OPENING_S) return plain("no_contact");
  if (!view) return plain("connecting");
  if (view.heard === "none") return plain("no_robot");
  const places = { operator: view.operator || "?" };
  const id = SITUATIONS[view.situation] ?? "starting";
  return { id, why: view.reason ?? "", act: todo(id, { hello, view, setup, doubt: seen.doubt }), places };
}

const plain = (id) => ({ id, why: "", act: `do.${id}`, places: {} });

function todo(id, { hello, view, setup, doubt }) {
  const may = Boolean(hello?.may?.act);
  if (id !== "holds") return `do.${id}`;
  if (doubt) return "do.holds.doubt";
  if (!may) return "do.holds.looking";
  if (view.deadman === false) return `do.holds.${setup?.deadman === "console" ? "key" : "deadman"}`;
  return "do.holds";
}

/** What else is so, beside the banner's state: ids of badges, in the order of their weight. */
export function badges(seen) {
  const { hello, view, setup, facts } = seen;
  const found = [];
  if (setup?.replay) found.push({ id: "replay" });
  if (view && !view.master && view.heard !== "none") found.push({ id: "no_master" });
  if (hello && hello.role !== "nobody" && !hello.may?.act && !setup?.replay) found.push({ id: "looking" });
  if (view?.lease === "ours") found.push({ id: "lease", places: { operator: view.operator } });
  if (view?.lease === "other") found.push({ id: "other", places: { operator: view.operator } });
  if (view?.lease === "none") found.push({ id: "free" });
  if (view?.deadman !== null && view?.deadman !== undefined) {
    found.push({ id: view.deadman ? "held" : "released" });
  }
  if (view?.resting?.length) found.push({ id: "resting", groups: view.resting });
  if (facts?.recorder) found.push({ id: "recording", places: { recording: String(facts.recorder.name ?? "") } });
  return found;
}

/**
 * A picture's age and whether it is too old to act upon. `since_s`: since it arrived at this page.
 *
 * Where the clocks' offset is not known (`age_ms` null), `age_s` is the least that it can be, and `known` is false.
 */
export function picture(header, page_ms, since_s, stale_s) {
  const known = typeof header.age_ms === "number";
  const age_s = known ? (header.age_ms + (page_ms ?? 0)) / 1000 + since_s : since_s;
  return { age_s, bound_ms: header.bound_ms, known, stale: age_s > stale_s };
}

/** Whether the console tells of a stop that was asked `since_s` ago or later: an older one is not this page's. */
export function confirms(stop, since_s) {
  return typeof stop?.since_s === "number" && stop.since_s <= since_s;
}

/**
 * The three lights of a stop, and whether the button can do anything.
 *
 * `asked`: what this page knows of its own request: null, "sending", "sent" or "not_sent".
 */
export function stopLights(id, view, asked) {
  const stop = view?.stop ?? null;
  const dead = id === "no_contact" || asked === "not_sent";
  return {
    dead,
    failed: asked === "not_sent" ? "not_sent" : stop?.failed ? "failed" : dead ? "no_contact" : "",
    words: stop?.failed ?? "",
    lights: [
      { id: "asked", on: Boolean(stop) || asked === "sent", at_s: stop?.asked_s ?? null },
      { id: "robot", on: stop ? stop.robot_s !== null : view?.guard === "estop", at_s: stop?.robot_s ?? null },
      { id: "stands", on: Boolean(stop) && stop.stands_s !== null, at_s: stop?.stands_s ?? null },
    ].map((light) => ({ ...light, on: light.on && (id !== "no_contact" || light.id === "asked") })),
  };
}

/** Joints that are further from the operator's target than `limit_deg`, worst first: [{joint, off_deg}]. */
export function joints_off(view, limit_deg) {
  const off = [];
  view.encoder.forEach((measured, joint) => {
    const target = view.target?.[joint];
    if (measured === null || target === null || target === undefined) return;
    const off_deg = (Math.abs(measured - target) * 180) / Math.PI;
    if (off_deg > limit_deg) off.push({ joint, off_deg });
  });
  return off.sort((a, b) => b.off_deg - a.off_deg);
}

/** The largest torque from outside at these joints as a share of what is full there; null where none is known. */
export function push(view, joints, full_nm) {
  const shares = joints
    .filter((joint) => typeof view.external_nm?.[joint] === "number")
    .map((joint) => Math.abs(view.external_nm[joint]) / full_nm[joint]);
  return shares.length ? Math.min(1, Math.max(...shares)) : null;
}

/** The figure of each state and badge, a path in 100 × 100: each differs from all others without its colour. */
export const SHAPES = {
  connecting: "M50 12A38 38 0 1 1 12 50", starting: "M25 12H75L25 88H75Z",
  no_robot: "M32 36C32 8 70 10 68 36C67 52 50 50 50 66M50 86V87", holds: "M33 18V82M67 18V82",
  aligns: "M8 50H38M24 34L40 50L24 66M92 50H62M76 34L60 50L76 66", follows: "M26 14L82 50L26 86Z",
  clutch: "M50 10L88 50L50 90L12 50Z", stopped: "M32 10H68L90 32V68L68 90H32L10 68V32Z",
  other: "M24 46H76V88H24ZM34 46V30A16 16 0 0 1 66 30V46", no_contact: "M18 18L82 82M82 18L18 82",
  locked: "M24 46H76V88H24ZM34 46V30A16 16 0 0 1 66 30V46M50 60V74", looking: "M8 50C28 20 72 20 92 50C72 80 28 80 8 50ZM50 44A6 6 0 1 0 50.1 44", lease: "M18 52L42 76L84 26",
  free: "M24 46H76V88H24ZM34 46V30A16 16 0 0 1 66 22", held: "M50 50m-30 0a30 30 0 1 0 60 0a30 30 0 1 0 -60 0",
  released: "M50 50m-30 0a30 30 0 1 0 60 0a30 30 0 1 0 -60 0M14 86L86 14", resting: "M14 70H86M30 70V44H86V70",
  recording: "M50 50m-24 0a24 24 0 1 0 48 0a24 24 0 1 0 -48 0", replay: "M44 20L14 50L44 80ZM86 20L56 50L86 80Z",
  no_master: "M12 88H88L50 16ZM50 44V62M50 76V77",
};
export const FILLED = new Set(["follows", "stopped", "held", "recording", "replay", "other"]);
