"""What recorders at both taps cost the loops, by turns with and without: the host slows both alike."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.wire.messages import Command, RobotState
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.recorders import start_recorders
from deploy.harness.rig import ROBOT, open_rig
from deploy.harness.start import start_all
from tests.hosts.test_console_load import later

if TYPE_CHECKING:
    from deploy.harness.observer import Heard
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(900)]
PHASE_S = float(os.environ.get("TANDEM_RECORDER_PHASE_S", "4"))
ROUNDS = int(os.environ.get("TANDEM_RECORDER_ROUNDS", "2"))
TICK_NS = 5 * NS_PER_MS
ROBOT_ROLES = ("master", "slave")


@dataclass
class Phase:
    """When loops turned, ns, each by its own host's clock."""

    robot_ns: list[int] = field(default_factory=list)
    """A state sent, which a tick does after its work."""
    master_ns: list[int] = field(default_factory=list)
    """SYNC sent, of the ticks that became commands."""


def quantiles(late: Array) -> Array:
    """p50, p90 and p99."""
    found: Array = np.quantile(late, (0.5, 0.9, 0.99))
    return found


def late_ms(turned_ns: Sequence[int], begins_ns: int) -> Array:
    """By how much turns of a loop, a tick apart, were late, ms; none was before `begins_ns` in its tick."""
    late: Array = ((np.array(turned_ns) - begins_ns) % TICK_NS) / NS_PER_MS
    return late


def begins(turned_ns: Sequence[int]) -> int:
    """Where in a tick the grid begins: with the first turn after the widest gap."""
    phases = np.sort(np.array(turned_ns) % TICK_NS)
    gaps = np.diff(np.concatenate([phases, phases[:1] + TICK_NS]))
    return int(phases[(int(gaps.argmax()) + 1) % len(phases)])


def test_the_lateness_of_turns_is_found_wherever_in_a_tick_the_grid_begins() -> None:
    random = np.random.default_rng(3)
    for begin in (0, 1_700_000, 4_999_000):
        late_ns = random.exponential(0.1 * NS_PER_MS, 2000).astype(np.int64)
        turned = (begin + np.arange(2000) * TICK_NS + late_ns).tolist()
        found = late_ms(turned, begins(turned))
        np.testing.assert_allclose(found, (late_ns - late_ns.min()) / NS_PER_MS, atol=1e-9)


def test_recorders_make_no_loop_late(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(_: HostWatch) -> None:
        folder = Path(tempfile.mkdtemp(dir=tmp_path))
        taps = {role: folder / f"{role}.sock" for role in ROBOT_ROLES}
        overrides = {role: [f'tap.socket="{path}"'] for role, path in taps.items()}
        phases = {recorded: Phase() for recorded in (False, True)}
        into = [Phase()]

        def take(message: Heard) -> None:
            if isinstance(message, RobotState):
                into[0].robot_ns.append(message.sent_ns)
            elif isinstance(message, Command):
                into[0].master_ns.append(message.stamps.sampled_ns)

        async with open_rig(overrides=overrides) as rig:
            await start_all(rig)
            await until_tracking(rig, ROBOT)
            rig.observer.listeners.append(take)
            for number in range(2 * ROUNDS):
                recorded = number % 2 == 1
                if recorded:
                    await start_recorders(rig, taps, Path(tempfile.mkdtemp(dir=folder)))
                await rig.until(later(1.0), 5.0, "a second")
                into[0] = phases[recorded]
                await rig.until(later(PHASE_S), 3.0 * PHASE_S, "states")
                into[0] = Phase()
                for name in [name for name in rig.children if name.startswith("record-")]:
                    assert await rig.children.pop(name).stop() == 0
        for loop in ("robot_ns", "master_ns"):
            alone, recorded_ns = (getattr(phases[recorded], loop) for recorded in (False, True))
            begin = begins(alone + recorded_ns)
            before, beside = (quantiles(late_ms(one, begin)) for one in (alone, recorded_ns))
            print(  # noqa: T201
                f"\n{loop}: p50, p90, p99 alone {before.round(3)} ms of {len(alone)}, recorded "
                f"{beside.round(3)} ms of {len(recorded_ns)}; ratio {(beside / before).round(2)}"
            )
            assert len(recorded_ns) > 10 * ROUNDS * PHASE_S
            assert beside[0] <= 1.25 * before[0] + 0.05
            assert beside[1] <= 1.5 * before[1] + 0.5

    on_this_host(story)
