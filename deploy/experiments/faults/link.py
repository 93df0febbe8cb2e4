"""What a link can do to messages, and what others can send over it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from common.clock import NS_PER_MS, to_ns
from common.wire.codec import decode, encode
from common.wire.messages import Action, Command, ControlReply, ControlRequest
from deploy.experiments.faults.scene import ENGAGED_S, REACHING_S, Scene, reach
from deploy.sim.world.troubles import Delivery, Troubles, Way
from deploy.sim.world.whole_way import VirtualRun, World

SOUND = Troubles().carry
JOINT_TURN_RAD = 0.5
"""How far foul commands ask every joint to be from where it is."""


def cut(scene: Scene) -> None:
    """Nothing passes, either way."""
    scene.run.troubles.carry = lambda way, payload: ()
    scene.undo = lambda: _heal(scene)


def held_back(scene: Scene, seconds: float = 1.0) -> None:
    """All that is sent within some time arrives at its end, in order, at once."""
    until_ns = scene.run.now_ns + to_ns(seconds)

    def carry(_: Way, payload: bytes) -> Sequence[Delivery]:
        return ((max(0, until_ns - scene.run.now_ns), payload),)

    scene.run.troubles.carry = carry


def slow(scene: Scene) -> None:
    """Every message takes half a second longer."""
    scene.run.troubles.carry = lambda _, payload: ((500 * NS_PER_MS, payload),)


def reordered(scene: Scene) -> None:
    """Every second command arrives after its successor."""
    odd = False

    def carry(way: Way, payload: bytes) -> Sequence[Delivery]:
        nonlocal odd
        if way is not Way.COMMAND:
            return ((0, payload),)
        odd = not odd
        return ((100 * NS_PER_MS if odd else 0, payload),)

    scene.run.troubles.carry = carry


def duplicated(scene: Scene) -> None:
    """Every message arrives three times: at once, 10 ms and 110 ms later."""
    scene.run.troubles.carry = lambda _, payload: (
        (0, payload), (10 * NS_PER_MS, payload), (110 * NS_PER_MS, payload),
    )  # fmt: skip


def replayed_yesterday(scene: Scene) -> None:
    """A whole session of another day, requests to claim and to engage included."""
    requests, commands = _yesterday()
    for request in requests:
        reply = scene.run.slave.on_control(request, scene.run.slave_ns)
        _note_grant(scene, reply, "yesterday's request")
    _play(scene, commands)


def replayed_today(scene: Scene) -> None:
    """The commands of this very session once more, each with the operator's lease."""
    _play(scene, [encode(command) for command in scene.run.commands if command.lease])


def second_operator(scene: Scene) -> None:
    """Another person asks for all that only the holder of the lease may have, and commands the robot."""
    for action in (Action.CLAIM, Action.ENGAGE, Action.DISENGAGE, Action.RELEASE):
        scene.ask(action, "nurse-2")

    def command() -> None:
        for lease in (0, 1, scene.newest().lease + 1):
            scene.command(encode(turned(replace(scene.newest(), lease=lease))))

    scene.each_period = command


def wrong_robot(scene: Scene) -> None:
    """What is meant for another robot comes to this one, with this one's lease."""

    def command() -> None:
        scene.command(encode(turned(replace(scene.newest(), robot="robot-2"))))

    scene.each_period = command


def turned(command: Command, by_rad: float = JOINT_TURN_RAD) -> Command:
    """A command as if it came next, that would be seen at the robot were it accepted."""
    return replace(command, sequence=command.sequence + 1, position_rad=command.position_rad + by_rad)


def change_commands(scene: Scene, change: Callable[[Command], Command]) -> None:
    """The master itself sends something else than it should."""
    joints = len(scene.skeleton.joints)

    def carry(way: Way, payload: bytes) -> Sequence[Delivery]:
        if way is Way.COMMAND:
            payload = encode(change(decode(payload, Command, joints)))
        return ((0, payload),)

    scene.run.troubles.carry = carry


def not_numbers(scene: Scene) -> None:
    """NaN and infinities, in bytes and past the codec."""

    def command() -> None:
        for value in (np.nan, np.inf, -np.inf):
            bad = turned(scene.newest(), value)
            with np.errstate(invalid="ignore"):
                scene.command(encode(bad))
            scene.command_decoded(bad)
            scene.command_decoded(replace(turned(scene.newest()), velocity_rad_s=bad.position_rad))

    scene.each_period = command


def huge(scene: Scene) -> None:
    """Angles no joint can have: 1e30 rad, and a hair beyond the two turns that a message may carry."""

    def command() -> None:
        for value in (1e30, -1e30, 12.6):
            scene.command(encode(turned(scene.newest(), value)))

    scene.each_period = command


def largest(scene: Scene) -> None:
    """The largest values a message may carry, for every joint: 12.5 rad, away from zero at 99 rad/s."""
    every = np.ones(len(scene.skeleton.joints))
    change_commands(scene, lambda c: replace(c, position_rad=12.5 * every, velocity_rad_s=99.0 * every))


def negative_zero(scene: Scene) -> None:
    """Every zero with a minus."""

    def minus(command: Command) -> Command:
        position, velocity = command.position_rad + 0.0, command.velocity_rad_s + 0.0
        position[position == 0.0] = velocity[velocity == 0.0] = -0.0
        return replace(command, position_rad=position, velocity_rad_s=velocity)

    change_commands(scene, minus)


def jump(scene: Scene) -> None:
    """From one command to the next every joint is at the far end of its range."""
    lower, upper = scene.skeleton.lower_rad, scene.skeleton.upper_rad
    far = np.where(scene.newest().position_rad > 0.5 * (lower + upper), lower, upper)
    change_commands(scene, lambda command: replace(command, position_rad=far))


def jumps(scene: Scene) -> None:
    """Every command asks for the other end of the range than the one before."""
    ends = [scene.skeleton.lower_rad, scene.skeleton.upper_rad]
    change_commands(scene, lambda command: replace(command, position_rad=ends[command.sequence % 2]))


def _heal(scene: Scene) -> None:
    scene.run.troubles.carry = SOUND


def _note_grant(scene: Scene, reply: bytes, what: str) -> None:
    if decode(reply, ControlReply).done:
        scene.granted.append(what)


def _play(scene: Scene, payloads: Sequence[bytes]) -> None:
    """In the order they were recorded, some hundred a second, so that many fall into the trial."""
    left = iter(payloads)

    def command() -> None:
        for _, payload in zip(range(8), left, strict=False):
            scene.command(payload)

    scene.each_period = command


@cache
def _yesterday() -> tuple[tuple[bytes, ...], tuple[bytes, ...]]:
    """Requests and commands of a run on another day: other clocks, other lease."""
    run = VirtualRun(World(slave_ahead_ns=86_400 * 10**9, motion=reach()))
    run.run(ENGAGED_S)
    challenge = run.ask(Action.STATUS).challenge
    operator, robot = run.master_config.operator.name, run.robot
    requests = [
        ControlRequest(robot, Action.CLAIM, operator),
        ControlRequest(robot, Action.ENGAGE, operator, challenge=challenge),
    ]
    run.run(REACHING_S)
    return tuple(map(encode, requests)), tuple(encode(c) for c in run.commands if c.lease)
