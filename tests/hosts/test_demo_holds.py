"""The demo's operator brings a robot back that held, and gives up on one that cannot be brought back."""

from __future__ import annotations

import signal
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from deploy.experiments.demo.operators import PATIENCE, DemoOperators
from deploy.harness.host import HostWatch
from deploy.harness.operator import OperatorPatience
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


async def started(rig: Rig, lines: list[str], patience: OperatorPatience) -> DemoOperators:
    await start_all(rig)
    operators = DemoOperators(rig, HostWatch(), lambda: None, lines.append, patience)
    await operators.follow(0.0)
    assert not operators.problem
    return operators


def test_a_robot_that_held_is_engaged_again_and_the_hold_is_reported(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        lines: list[str] = []
        async with open_rig() as rig:
            # however often this host stands still
            operators = await started(rig, lines, replace(PATIENCE, holds=None))
            before = len(operators.holds())
            rig.children["master"].send(signal.SIGSTOP)
            await rig.until(lambda: rig.observer.guard == "hold", 10.0, "hold")
            rig.children["master"].send(signal.SIGCONT)
            await operators.follow(0.5)
            assert not operators.problem
            assert rig.observer.guard == "track"
            holds = operators.holds()[before:]
            assert any("no command" in hold.reason or "lease" in hold.reason for hold in holds), holds
            assert all(hold.lasted_s and hold.lasted_s > 0.0 for hold in holds)
            assert any("engages again" in line for line in lines)
            assert any("tracks again" in line for line in lines)
            await operators.let_go()
            assert rig.observer.guard == "hold"

    on_this_host(story)


def test_a_robot_whose_master_is_gone_is_given_up(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        async with open_rig() as rig:
            await start_all(rig)
            operators = DemoOperators(rig, HostWatch(), lambda: None, print, OperatorPatience(back_s=10.0))
            await operators.follow(0.0)
            await rig.children["master"].kill()
            await rig.until(lambda: rig.observer.guard == "hold", 10.0, "hold")
            await operators.follow(0.5)
            assert "did not track for 10 s: hold (" in operators.problem
            assert operators.holds()[-1].lasted_s is None

    on_this_host(story)
