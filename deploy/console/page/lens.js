// Where a robot's links stand in the picture of one of its cameras (common/metrics/lens.py). No document, no clock.
import { multiply, placeLinks, rotate } from "./kinematics.js";

const NEAR_M = 0.05; // what is nearer to the camera, or behind it, is not drawn
const BENT = 1.5; // beyond so many times the picture's corner a lens's polynomial says nothing

const conjugate = ([w, x, y, z]) => [w, -x, -y, -z];

/** Turns points of the base into the axes of a camera that stands on a link of the robot at `positions`. */
function intoCamera(lens, links, positions) {
  const carrier = links.findIndex((link) => link.name === lens.link);
  const base = { origin: [0, 0, 0], q: [1, 0, 0, 0] };
  const { origin, q } = carrier < 0 ? base : placeLinks(links, positions)[carrier];
  const at = rotate(q, lens.position_m).map((value, k) => value + origin[k]);
  const turn = conjugate(multiply(q, lens.q_link_from_camera));
  return (point) => rotate(turn, point.map((value, k) => value - at[k]));
}

/** Pixels of a point (m, in the camera's axes) that lies ahead. */
function pixel(lens, [x, y, z], width, height) {
  const [k1, k2] = lens.radial;
  const corner = Math.hypot(0.5 / lens.focal[0], 0.5 / lens.focal[1]);
  const r2 = (x * x + y * y) / (z * z);
  const bend = r2 < (BENT * corner) ** 2 ? 1 + k1 * r2 + k2 * r2 * r2 : 1;
  const of = (value, axis, size) => size * (lens.centre[axis] + (lens.focal[axis] * bend * value) / z);
  return [of(x, 0, width), of(y, 1, height)];
}

/** The part of a line between two points that lies ahead of the camera; null where none does. */
function ahead(from, to) {
  if (from[2] < NEAR_M && to[2] < NEAR_M) return null;
  const cut = (behind, before) => {
    if (behind[2] >= NEAR_M) return behind;
    const share = (NEAR_M - behind[2]) / (before[2] - behind[2]);
    return behind.map((value, k) => value + share * (before[k] - value));
  };
  return [cut(from, to), cut(to, from)];
}

/**
 * Bars [{ link, from, to, radii, wide }] in pixels: those of the links where the robot will be, with the radius at either
 * end, alone and with what it may be off. `now`: the positions by which the camera itself stands; `will`: those of the
 * robot that is drawn; `more_m`: by how much each link may be off. A bar of the link that carries the camera is left
 * out: it would fill the picture.
 */
export function bars(lens, links, { now, will, more_m }, width, height) {
  const into = intoCamera(lens, links, now);
  const carrier = links.findIndex((link) => link.name === lens.link);
  return placeLinks(links, will).flatMap(({ origin, q }, i) => links[i].capsules.flatMap((bar) => {
    if (i === carrier) return [];
    const ends = [bar.from_m, bar.to_m].map((end) => into(rotate(q, end).map((value, k) => value + origin[k])));
    const seen = ahead(...ends);
    if (!seen) return [];
    const [from, to] = seen.map((end) => pixel(lens, end, width, height));
    const radii = (radius_m) => seen.map(([, , z]) => (radius_m * lens.focal[1] * height) / z);
    return [{ link: i, from, to, radii: radii(bar.radius_m), wide: radii(bar.radius_m + more_m[i]) }];
  }));
}
