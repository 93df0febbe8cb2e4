"""The curves of a run as a PNG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from common.quaternion import Array
from deploy.experiments.demo.curves import CurveGroup, Curves
from deploy.report.plots import colour, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def as_png(drawn: Curves, path: Path) -> None:
    """A row a group: angles, and angular velocities; the robot's in full lines, the operator's dotted."""
    robot, operator = drawn.robot, drawn.operator

    def draw(figure: Figure) -> None:
        places = figure.subplots(len(drawn.groups), 2, sharex=True, squeeze=False)
        for (left, right), group in zip(places, drawn.groups, strict=True):
            _draw(left, drawn.time_s, robot.angle_deg, operator.angle_deg if operator else None, group)
            _draw(right, drawn.time_s, robot.rate_deg_s, operator.rate_deg_s if operator else None, group)
            left.set_ylabel(f"{group.title}, °")
            right.set_ylabel("°/s")
            left.legend(loc="lower left", bbox_to_anchor=(0.0, 0.99), ncols=len(group.joints))
        for place in places[-1]:
            place.set_xlabel("time in track, s")
        dotted = "" if operator is None else "; dotted: the operator's true ones"
        figure.suptitle(f"angle and angular velocity by the robot's encoders{dotted}")

    save_png(path, draw, 12.0, 2.1 * len(drawn.groups) + 0.8)


def _draw(place: Axes, time_s: Array, robot: Array, operator: Array | None, group: CurveGroup) -> None:
    for k, (joint, label) in enumerate(zip(group.joints, group.labels, strict=True)):
        place.plot(time_s, robot[:, joint], colour(k), linewidth=1.2, label=label)
        if operator is not None:
            place.plot(time_s, operator[:, joint], "k:", linewidth=0.8)
