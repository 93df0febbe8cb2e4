"""The demo's operator brings a robot back that held, and gives up on one that cannot be brought back."""

from __future__ import annotations

import asyncio
import signal
from typing import TYPE_CHECKING

import pytest

from deploy.harness import operator as rule
from deploy.harness.host import Host
from deploy.harness.rig import ROLES, Rig, open_rig
from deploy.harness.tend import Tending

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.hosts, pytest.mark.timeout(400)]


async def tended(rig: Rig, said: list[str]) -> Tending:
    for role in ROLES:
        await rig.start(role)
    await rig.until(lambda: rig.observer.ready, 60.0, "readiness")
    tending = Tending(rig, Host(), asyncio.Event(), lambda: None, said.append)
    await tending.until_all_track()
    assert not tending.problem
    return tending


def test_a_robot_that_held_is_engaged_again_by_an_act_and_the_hold_is_told(
    monkeypatch: pytest.MonkeyPatch, on_this_host: OnThisHost
) -> None:
    monkeypatch.setattr(rule, "HOLDS", 100)  # however often this host stands still

    async def story(_: Host) -> None:
        said: list[str] = []
        async with open_rig() as rig:
            tending = await tended(rig, said)
            before = len(tending.rows())
            rig.children["master"].send(signal.SIGSTOP)
            await rig.until(lambda: rig.observer.guard == "hold", 10.0, "hold")
            rig.children["master"].send(signal.SIGCONT)
            await tending.watch(0.5)
            assert not tending.problem
            assert rig.observer.guard == "track"
            rows = tending.rows()[before:]
            assert any("no command" in row["reason"] or "lease" in row["reason"] for row in rows), rows
            assert all(row["lasted_s"] > 0.0 for row in rows)
            assert any("engages again" in line for line in said)
            assert any("tracks again" in line for line in said)
            await tending.let_go()
            assert rig.observer.guard == "hold"

    on_this_host(story)


def test_a_robot_whose_master_is_gone_is_given_up(
    monkeypatch: pytest.MonkeyPatch, on_this_host: OnThisHost
) -> None:
    async def story(_: Host) -> None:
        async with open_rig() as rig:
            tending = await tended(rig, [])
            with monkeypatch.context() as patched:
                patched.setattr(rule, "BACK_S", 3.0)
                await rig.children["master"].kill()
                await tending.watch(0.5)
            assert "did not track for 3 s: hold (" in tending.problem
            assert tending.rows()[-1]["lasted_s"] is None

    on_this_host(story)
