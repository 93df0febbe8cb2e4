"""What the demo shows while it runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from common.metrics.parts import Summary
from deploy.client.efforts import largest
from deploy.experiments.demo.tables import stage_cells
from deploy.report.tables import GUARD_STYLE, UNKNOWN, plain_table


@dataclass(frozen=True, slots=True)
class Live:
    """What the live view shows of a running pair."""

    elapsed_s: float
    guard: str
    reason: str
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    """Such as capture, commands, states."""
    stages: Mapping[str, Summary] = field(default_factory=dict)
    joint_error_deg: Mapping[str, float] = field(default_factory=dict)
    """Encoder minus truth now, by joint; the worst few are shown."""
    effort_nm: Mapping[str, float | None] = field(default_factory=dict)
    """Torque of each motor at its joint; the largest few are shown."""
    drops: Mapping[str, int] = field(default_factory=dict)
    """What was lost or refused, by reason; zeros are not shown."""


def live_view(live: Live, worst: int = 5) -> RenderableType:
    """One screen, redrawn a few times a second."""
    head = Text.assemble(
        f"{live.elapsed_s:6.1f} s   robot ", (live.guard or UNKNOWN, GUARD_STYLE.get(live.guard, "")),
        f"   {live.reason}", overflow="ellipsis", no_wrap=True,
    )  # fmt: skip
    rates = "   ".join(f"{name} {rate:.1f} Hz" for name, rate in live.rates_hz.items()) or UNKNOWN
    errors = sorted(live.joint_error_deg.items(), key=lambda item: -abs(item[1]))[:worst]
    dropped = "   ".join(f"{name} {count}" for name, count in live.drops.items() if count)
    joints = Text("   ".join(f"{name} {error:+.1f}°" for name, error in errors) or UNKNOWN)
    lines = Table.grid(padding=(0, 2))
    lines.add_row(Text("rates", "dim"), Text(rates))
    lines.add_row(Text("worst joints", "dim"), joints)
    lines.add_row(Text("effort", "dim"), Text(largest(live.effort_nm, "   ") or UNKNOWN))
    lines.add_row(Text("dropped", "dim"), Text(dropped, "yellow") if dropped else Text("nothing", "green"))
    table = plain_table("stage, ms", "mean", "p50", "p99", "max", "count")
    for name, stage in live.stages.items():
        table.add_row(name, *stage_cells(stage))
    return Group(head, lines, table)
