// The robot that will be: how thick its uncertainty makes each link. No document, no clock.
import { placeLinks, rotate } from "./kinematics.js";

const MOST_M = 0.15; // wider than that says no more

/**
 * For every link, by how much a point at its far end may be off, m: the root of the sum of squares of what each
 * joint's half-width (rad) does at its distance from that joint. `placed`: as `placeLinks` gives it.
 */
export function tubes(links, placed, tube_rad) {
  const chains = [];
  return links.map((link, i) => {
    const own = link.hinges.map((hinge) => ({
      half: Math.hypot(...hinge.joints.map(([joint, ratio]) => ratio * (tube_rad[joint] ?? 0))),
      at: placed[i].origin,
      slides: hinge.slides,
    }));
    chains[i] = [...(link.parent < 0 ? [] : chains[link.parent]), ...own];
    const ends = link.capsules.flatMap((capsule) => [capsule.from_m, capsule.to_m]);
    const far = ends.map((end) => rotate(placed[i].q, end).map((value, k) => value + placed[i].origin[k]));
    const off = far.map((end) =>
      Math.hypot(...chains[i].map(({ half, at, slides }) => half * (slides ? 1 : Math.hypot(...end.map((value, k) => value - at[k]))))));
    return Math.min(MOST_M, Math.max(0, ...off));
  });
}

/**
 * Where the robot is seen and where it is by now, of a view: { now, will, more_m }; null where it is not foretold, or
 * where an encoder is not valid: the camera itself may stand elsewhere then.
 */
export function foretold(view, links) {
  const now = view.encoder;
  if (!view.ahead || view.heard === "none" || now.includes(null)) return null;
  const will = now.map((angle, j) => view.ahead.position[j] ?? angle);
  return { now, will, more_m: tubes(links, placeLinks(links, will), view.ahead.tube) };
}
