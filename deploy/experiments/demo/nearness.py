"""How near the robot's parts came to each other, and how near the operator's angles would bring them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from rich.text import Text

from common.skeleton import Skeleton
from common.wire.messages import RobotState
from deploy.measure import TruthSeries
from deploy.measure.apart import Distances

EVERY = 4
"""Truth comes 200 times a second, states 50 times."""


@dataclass(frozen=True, slots=True)
class Nearness:
    """Least distances between two parts, or a part and the stand, m; below 0: inside each other."""

    margin_m: float
    operator_m: float
    """With the operator's true angles."""
    setpoint_m: float
    """With the robot's setpoints."""
    encoder_m: float
    """With the angles of its encoders."""
    held_back: tuple[str, ...]
    """What the states told, each once."""


def nearness(
    truth: TruthSeries, states: Iterable[RobotState], skeleton: Skeleton, margin_m: float
) -> Nearness | None:
    """None where nothing was heard, or the robot has no parts that could meet."""
    heard = [state for state in states if state.guard == "track"]
    distances = Distances(skeleton)
    if not heard or not len(truth.position_rad):
        return None
    operator, setpoint, encoder = (
        float(distances.own_m(course).min())
        for course in (
            truth.position_rad[::EVERY],
            np.array([state.setpoint_rad for state in heard]),
            np.array([state.position_rad for state in heard]),
        )
    )
    words = dict.fromkeys(state.faults["distance"] for state in heard if "distance" in state.faults)
    return Nearness(margin_m, operator, setpoint, encoder, tuple(words)) if operator < np.inf else None


def nearness_text(found: Nearness) -> Text:
    """One line, and one more where something was held back."""
    cm = [
        f"{100.0 * m:.1f} cm" for m in (found.operator_m, found.setpoint_m, found.encoder_m, found.margin_m)
    ]
    robot = f"robot {cm[1]} (encoders {cm[2]})"
    text = Text(f"least distance of two parts: operator {cm[0]}, {robot}, margin {cm[3]}")
    if found.held_back:
        text.append(f"\n{'; '.join(found.held_back[:4])}", "yellow")
    return text
