"""Faults by others: recordings played back, a second operator, commands or a robot of the wrong name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.presence import ProcessPresence
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S
from deploy.harness.faults.scene import ENGAGED_S, REACHING_S, Scene, reach, turned
from deploy.harness.faults.virtual import goes_on, holds
from deploy.sim.world.world import VirtualWorld, WorldSettings


def _replayed_yesterday(scene: Scene) -> None:
    requests, commands = _yesterday(scene.profile)
    for request in requests:
        own = scene.run.master_config.operator.name
        if decode(scene.run.slave.on_control(request, scene.run.slave_ns, sender=own), ControlReply).done:
            scene.granted.append("yesterday's request")
    _play(scene, commands)


@cache
def _yesterday(profile: str) -> tuple[tuple[bytes, ...], tuple[bytes, ...]]:
    """Requests and commands of a run on another day: other clocks, other lease."""
    run = VirtualWorld(WorldSettings(slave_ahead_ns=86_400 * 10**9, motion=reach(profile), profile=profile))
    run.run(ENGAGED_S)
    challenge = run.ask(Action.STATUS).challenge
    operator, robot = run.master_config.operator.name, run.robot
    requests = [
        ControlRequest(robot, Action.CLAIM, operator),
        ControlRequest(robot, Action.ENGAGE, operator, challenge=challenge),
    ]
    run.run(REACHING_S)
    return tuple(map(encode, requests)), tuple(encode(c) for c in run.commands if c.lease)


def _replayed_today(scene: Scene) -> None:
    _play(scene, [encode(command) for command in scene.run.commands if command.lease])


def _play(scene: Scene, payloads: Sequence[bytes]) -> None:
    """In the order of the recording, a hundred a second, so that many fall into the trial."""
    left = iter(payloads)

    def command() -> None:
        for _, payload in zip(range(8), left, strict=False):
            scene.command(payload)

    scene.each_period = command


def _second_operator(scene: Scene) -> None:
    for action in (Action.CLAIM, Action.ENGAGE, Action.DISENGAGE, Action.RELEASE):
        scene.ask(action, "nurse-2")

    def command() -> None:
        for lease in (0, 1, scene.newest().lease + 1):
            scene.command(encode(turned(replace(scene.newest(), lease=lease))))

    scene.each_period = command


def _wrong_robot(scene: Scene) -> None:
    def command() -> None:
        scene.command(encode(turned(replace(scene.newest(), robot="robot-2"))))

    scene.each_period = command


def _namesake(scene: Scene) -> None:
    other = ProcessPresence(scene.run.robot, "slave", 2, 1, "1.0", "another room, tcp/192.168.7.9:7447")
    scene.run.slave.namesakes.on_presence(other, here=True)


STRANGERS = (
    goes_on(
        name="yesterday's recording replayed",
        done="A session of another day, its requests to claim and to engage included, beside the operator's.",
        robot="Follows its operator. Nothing of the recording is accepted.",
        person="Find the sender.",
        act=_replayed_yesterday,
        strays_deg=0.0,
        refused_by={"lease"}, held_by={"lease", "sequence", "age", "future"},
    ),
    goes_on(
        name="this session's recording replayed",
        done="The operator's own commands of the last seconds once more.",
        robot="Follows its operator. Nothing of the recording is accepted.",
        person="Find the sender.",
        act=_replayed_today,
        strays_deg=0.0, refused_by={"sequence"}, held_by={"sequence", "age"},
    ),
    goes_on(
        name="second operator",
        done="Another person claims, engages, disengages, releases, and sends commands 12.5 times a second.",
        robot="Follows its operator, and names that operator to the other. "
        "Only an emergency stop is open to everybody.",
        person="Nothing; or the operator releases the robot, and the other claims it.",
        act=_second_operator,
        strays_deg=0.0, refused_by={"lease"}, held_by={"lease"},
    ),
    goes_on(
        name="wrong robot",
        done="Commands for another robot arrive here, with this robot's own lease.",
        robot="Follows its operator. What is not for it is not accepted.",
        person="Correct the robot's name in the file of the other side.",
        act=_wrong_robot,
        strays_deg=0.0, refused_by={"robot"}, held_by={"robot"},
    ),
    holds(
        name="another robot of the same name",
        done="A second robot starts under this one's name: nobody knows which of the two an order is for.",
        robot="Brakes all joints and stands; names where the other is. "
        "Nobody can engage while both are there.",
        person="Give each robot a name of its own (`robot` in its file); then engage.",
        act=_namesake,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by={"namesake"},
    ),
)  # fmt: skip
