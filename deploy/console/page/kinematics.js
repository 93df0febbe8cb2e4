// Forward kinematics of a robot: joint positions to the place of every link (common/skeleton/links.py, place_links).
// Quaternions are [w, x, y, z] and rotate the link's coordinates into the base's. Angles in rad, lengths in m.

export function multiply([a, b, c, d], [w, x, y, z]) {
  return [
    a * w - b * x - c * y - d * z,
    a * x + b * w + c * z - d * y,
    a * y - b * z + c * w + d * x,
    a * z + b * y - c * x + d * w,
  ];
}

export function rotate([w, x, y, z], [a, b, c]) {
  const [i, j, k] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i];
}

export function fromAxisAngle([x, y, z], angle) {
  const s = Math.sin(angle / 2);
  return [Math.cos(angle / 2), s * x, s * y, s * z];
}

const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/** Origin and orientation of every link, base from link, in the order of `setup.links`. Positions in joint order. */
export function placeLinks(links, positions) {
  const placed = [];
  for (const link of links) {
    const parent = link.parent < 0 ? { origin: [0, 0, 0], q: [1, 0, 0, 0] } : placed[link.parent];
    let origin = plus(parent.origin, rotate(parent.q, link.origin_m));
    let q = multiply(parent.q, link.q_parent_from_link);
    for (const hinge of link.hinges) {
      const value = hinge.joints.reduce((sum, [joint, ratio]) => sum + ratio * positions[joint], 0);
      if (hinge.slides) {
        origin = plus(origin, rotate(q, hinge.axis.map((a) => a * value)));
        continue;
      }
      const turned = multiply(q, fromAxisAngle(hinge.axis, value));
      origin = minus(plus(origin, rotate(q, hinge.anchor_m)), rotate(turned, hinge.anchor_m));
      q = turned;
    }
    placed.push({ origin, q });
  }
  return placed;
}

/** For every link, the places of the joints that turn it: to colour it by their torques. */
export function jointsOfLinks(links) {
  return links.map((link) => link.hinges.flatMap((hinge) => hinge.joints.map(([joint]) => joint)));
}
