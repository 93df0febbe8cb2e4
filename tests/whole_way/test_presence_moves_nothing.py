"""Whatever is announced, asked or called around a robot: it moves exactly as without it."""

from __future__ import annotations

import numpy as np

from common.wire.call import CallRequest, pack_call
from common.wire.messages import Action
from common.wire.presence import ProcessPresence
from common.wire.together import TOGETHER, beside
from deploy.sim.world.world import VirtualWorld, WorldSettings

SECONDS, EVERY_S = 3.0, 0.1
LEAST_RAD = 0.02


def play(world: VirtualWorld, disturbed: bool) -> list[bytes]:
    """The states' setpoints of some seconds, with or without everything that people may do meanwhile."""
    begins = len(world.states)
    for turn in range(round(SECONDS / EVERY_S)):
        if disturbed:
            disturb(world, turn)
        world.run(EVERY_S)
    return [state.setpoint_rad.tobytes() for state in world.states[begins:]]


def disturb(world: VirtualWorld, turn: int) -> None:
    slave = world.slave
    for operator in ("nurse-2", "nurse-3", ""):
        world.ask(Action.TAKE, operator=operator)
        world.ask(Action.RELEASE, operator=operator)
        world.ask(Action.ENGAGE, TOGETHER, operator=operator)
    world.ask(Action.TAKE)
    call = pack_call(CallRequest(turn % 2 == 0, "help"))
    slave.announcer.on_call(call, slave.guard, world.slave_ns)
    slave.announcer.pressed(slave.guard, world.slave_ns)
    slave.summary(world.slave_ns)
    masters = ProcessPresence(world.robot, "master", 100 + turn, 4, "1.0", "elsewhere")
    slave.namesakes.on_presence(masters, True)


def test_a_robot_that_follows_follows_as_before() -> None:
    plain, disturbed = VirtualWorld(WorldSettings()), VirtualWorld(WorldSettings())
    for world in (plain, disturbed):
        world.engage()
    one, other = play(plain, False), play(disturbed, True)
    assert one == other
    assert disturbed.slave.guard.state == "track"
    first, last = (np.frombuffer(one[i]) for i in (0, -1))
    assert np.abs(last - first).max() > LEAST_RAD, "it moved all the while"


def test_a_robot_that_nobody_engaged_stands() -> None:
    world = VirtualWorld(WorldSettings())
    world.run(3.0)
    setpoints = set(play(world, True))
    assert world.slave.guard.state == "hold"
    assert len(setpoints) == 1


def test_beside_another_only_a_deliberate_engage_moves_a_robot() -> None:
    world = VirtualWorld(WorldSettings())
    world.run(10.0, until=world._suit_known)
    world.run(2.0)
    # as the master's commands say while another robot follows
    world.slave.guard._commands.operator_doubt = beside(["robot-2"])
    refused = world.ask(Action.ENGAGE)
    assert not refused.done
    assert "robot-2" in refused.text
    assert not world.ask(Action.ENGAGE, "yes").done
    world.slave.guard._commands.operator_doubt = "a node lies"
    assert not world.ask(Action.ENGAGE, TOGETHER).done, "it passes over nothing else"
    world.slave.guard._commands.operator_doubt = beside(["robot-2"])
    assert world.ask(Action.ENGAGE, TOGETHER).done
