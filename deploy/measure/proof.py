"""Motion to motion: what a node on the robot's hand saw, beside what tandem's stamps claim. Pure.

The node on the hand belongs to no part of tandem that it judges. Each row compares two motions, or a
picture's own time with its stamp, and so names where time was lost or a stamp is wrong:

    operator's hand ─▶ setpoint ─▶ robot's hand          encoder's stamp against the hand       camera's stamp
    (suit, link, prediction)  (drives)                   (0 where it is right)                  (0 likewise)

A servo that is later than it should be shows between setpoint and hand, and the encoder agrees with the hand.
An encoder whose reading is older than its stamp shows against the hand, which still follows the setpoint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ms
from common.clock_sync import Offset
from deploy.measure.delay import AngularSpeed, MotionDelay, find_delay

HAND_TO_HAND = "hand → hand"
HAND_TO_SETPOINT = "operator's hand → setpoint"
SERVO = "setpoint → robot's hand"
ENCODER = "encoder's stamp"
CAMERA = "camera's stamp"
SCENE_TO_EYE = "scene → eye"
LOOP = "full loop"
NEAR_S = (-0.3, 0.5)
"""Between two signals of one host."""
WRONG_MS = 5.0
"""A stamp that is off by more than this, beyond the bound, is wrong."""
LEAST_PICTURES = 10


@dataclass(frozen=True, slots=True)
class SeenCode:
    """One picture that showed a time."""

    scene_ns: int
    """What it showed, robot's clock."""
    stamp_ns: int
    """When the camera's stamp says that it was taken, robot's clock."""
    eye_ns: int
    """When it was on the screen, operator's clock."""


@dataclass(frozen=True, slots=True)
class Motions:
    """One run, recorded."""

    operator_hand: AngularSpeed
    """By the suit's node, operator's clock."""
    setpoint: AngularSpeed
    """Of the hand by the setpoints, robot's clock, as all that follow."""
    encoder: AngularSpeed
    robot_hand: AngularSpeed
    """By the node that is taped to it."""
    offset: Offset
    """The robot's clock minus the operator's."""
    pictures: Sequence[SeenCode] = ()


@dataclass(frozen=True, slots=True)
class Claims:
    """What tandem's own stamps say; None where they say nothing."""

    hand_to_hand_ms: float | None = None
    """Sampled → moved, the mean."""
    servo_ms: float | None = None
    """What the tracker takes the drives' delay for (`bus_lag_s`)."""
    scene_to_eye_ms: float | None = None


@dataclass(frozen=True, slots=True)
class ProofRow:
    """One figure; None where it cannot be said, and why."""

    name: str
    found_ms: float | None
    bound_ms: float | None
    claimed_ms: float | None
    why: str = ""
    wrong: bool = False
    """A stamp that the hand, or the picture, refutes."""


def prove(motions: Motions, claims: Claims) -> list[ProofRow]:
    """Every row, in the order in which they are printed."""
    ours = motions.operator_hand
    # on the robot's clock
    operator = AngularSpeed(ours.at_ns + motions.offset.offset_ns, ours.rad_s)
    clock_ms = to_ms(motions.offset.bound_ns)
    hand = _row(HAND_TO_HAND, find_delay(operator, motions.robot_hand), clock_ms, claims.hand_to_hand_ms)
    servo = find_delay(motions.setpoint, motions.robot_hand, NEAR_S)
    eye = _scene_to_eye(motions, clock_ms, claims)
    return [
        hand,
        _row(HAND_TO_SETPOINT, find_delay(operator, motions.setpoint), clock_ms, None),
        _row(SERVO, servo, 0.0, claims.servo_ms),
        _stamp(ENCODER, _stamp_late(find_delay(motions.robot_hand, motions.encoder, NEAR_S))),
        _stamp(
            CAMERA, _pictures(CAMERA, [one.stamp_ns - one.scene_ns for one in motions.pictures], 0.0, 0.0)
        ),
        eye,
        _loop(hand, eye, clock_ms, claims),
    ]


def _row(name: str, found: MotionDelay | str, clock_ms: float, claimed_ms: float | None) -> ProofRow:
    if isinstance(found, str):
        return ProofRow(name, None, None, claimed_ms, found)
    return ProofRow(name, to_ms(found.delay_ns), to_ms(found.bound_ns) + clock_ms, claimed_ms)


def _stamp_late(found: MotionDelay | str) -> ProofRow:
    return _row(ENCODER, found, 0.0, 0.0)


def _stamp(name: str, row: ProofRow) -> ProofRow:
    """A stamp is claimed to be right: how far it is off must be within its bound, nearly."""
    if row.found_ms is None or row.bound_ms is None or abs(row.found_ms) - row.bound_ms <= WRONG_MS:
        return row
    late = f"{abs(row.found_ms):.1f} ms {'after' if row.found_ms > 0 else 'before'}"
    what = "the encoders tell a motion" if name == ENCODER else "the stamp of a picture lies"
    than = "the hand makes it" if name == ENCODER else "what it shows"
    return ProofRow(name, row.found_ms, row.bound_ms, row.claimed_ms, f"{what} {late} {than}", wrong=True)


def _pictures(name: str, each_ns: Sequence[int], clock_ms: float, claimed_ms: float | None) -> ProofRow:
    """The median, and three of its standard errors (by the quartiles)."""
    if len(each_ns) < LEAST_PICTURES:
        why = f"{len(each_ns)} of at least {LEAST_PICTURES} pictures with a readable code"
        return ProofRow(name, None, None, claimed_ms, why)
    low, middle, high = np.percentile(np.asarray(each_ns, dtype=float), (25.0, 50.0, 75.0))
    error_ns = 3.0 * 1.2533 * (high - low) / 1.349 / np.sqrt(len(each_ns))
    return ProofRow(name, to_ms(float(middle)), to_ms(float(error_ns)) + clock_ms, claimed_ms)


def _scene_to_eye(motions: Motions, clock_ms: float, claims: Claims) -> ProofRow:
    late_ns = [motions.offset.remote_ns(one.eye_ns) - one.scene_ns for one in motions.pictures]
    return _pictures(SCENE_TO_EYE, late_ns, clock_ms, claims.scene_to_eye_ms)


def _loop(hand: ProofRow, eye: ProofRow, clock_ms: float, claims: Claims) -> ProofRow:
    """From the scene to the eye, and from the operator's hand to the robot's: not the person between them.

    What the clocks' offset is wrong by cancels: one way is the longer by it, the other the shorter.
    """
    known = (claims.hand_to_hand_ms, claims.scene_to_eye_ms)
    claimed_ms = None if known[0] is None or known[1] is None else known[0] + known[1]
    if hand.found_ms is None or eye.found_ms is None or hand.bound_ms is None or eye.bound_ms is None:
        missing = hand.name if hand.found_ms is None else eye.name
        return ProofRow(LOOP, None, None, claimed_ms, f"{missing} is not known")
    bound_ms = hand.bound_ms + eye.bound_ms - 2.0 * clock_ms
    return ProofRow(LOOP, hand.found_ms + eye.found_ms, bound_ms, claimed_ms)
