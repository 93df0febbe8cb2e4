"""The curves of a run for a person: in the terminal, and as a PNG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Group as Lines
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from common.quaternion import Array
from deploy.experiments.demo.braille import COLOURS, plot
from deploy.experiments.demo.curves import Curves, Group
from deploy.measure.roughness import GRID_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_GROUPS = 6
"""A robot with more of them would push the verdicts off the screen: a PNG shows those."""
NEWEST_S = 15.0
"""The terminal shows the end of a longer run."""
_COLUMNS, _ROWS = 31, 5
_PNG_DPI = 110


def in_terminal(drawn: Curves) -> RenderableType | None:
    """What the encoders showed, a row a group: angles, and angular velocities; 80 columns wide."""
    if len(drawn.groups) > MOST_GROUPS:
        return None
    rows = slice(-round(NEWEST_S / GRID_S), None)
    table = Table.grid(padding=(0, 2))
    for group in drawn.groups:
        title = Text(f"{group.title}: ", "bold")
        for label, colour in zip(group.labels, COLOURS, strict=False):
            title.append(f"{label} ", colour)
        table.add_row(title, Text("angular velocity, °/s", "dim"))
        columns = list(group.joints)
        angle, rate = drawn.robot.angle_deg[rows][:, columns], drawn.robot.rate_deg_s[rows][:, columns]
        table.add_row(plot(list(angle.T), _COLUMNS, _ROWS, "°"), plot(list(rate.T), _COLUMNS, _ROWS, ""))
    time_s = drawn.time_s[rows]
    head = f"angle and angular velocity of each joint, {time_s[0]:.1f} to {time_s[-1]:.1f} s of the run"
    return Lines(Text(head, "italic"), table)


def as_png(drawn: Curves, path: Path) -> None:
    """A row a group: angles, and angular velocities; the robot's in full lines, the operator's dotted."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    count = len(drawn.groups)
    figure = Figure(figsize=(12.0, 2.1 * count + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    places = figure.subplots(count, 2, sharex=True, squeeze=False)
    robot, operator = drawn.robot, drawn.operator
    for (left, right), group in zip(places, drawn.groups, strict=True):
        _draw(left, drawn.time_s, robot.angle_deg, operator.angle_deg if operator else None, group)
        _draw(right, drawn.time_s, robot.rate_deg_s, operator.rate_deg_s if operator else None, group)
        left.set_ylabel(f"{group.title}, °")
        right.set_ylabel("°/s")
        left.legend(loc="lower left", bbox_to_anchor=(0.0, 0.99), frameon=False, ncols=len(group.joints))
    for place in places[-1]:
        place.set_xlabel("time in track, s")
    dotted = "" if operator is None else "; dotted: the operator's true ones"
    figure.suptitle(f"angle and angular velocity by the robot's encoders{dotted}")
    figure.savefig(path, format="png", dpi=_PNG_DPI)


def _draw(place: Axes, time_s: Array, robot: Array, operator: Array | None, group: Group) -> None:
    for k, (joint, label) in enumerate(zip(group.joints, group.labels, strict=True)):
        place.plot(time_s, robot[:, joint], f"C{k}", linewidth=1.2, label=label)
        if operator is not None:
            place.plot(time_s, operator[:, joint], "k:", linewidth=0.8)
    place.grid(alpha=0.3)
