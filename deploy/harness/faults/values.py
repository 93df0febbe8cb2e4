"""Commands whose values no operator means: not numbers, too large, jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from common.wire.codec import decode, encode
from common.wire.messages import Command
from deploy.harness.faults.fault import NOTHING
from deploy.harness.faults.scene import Scene, turned
from deploy.harness.faults.virtual import follows_limited, goes_on
from deploy.sim.world.injection import Delivery, Traffic

LET_GO = "Let go of the deadman, or emergency stop."


def _change_commands(scene: Scene, change: Callable[[Command], Command]) -> None:
    """The master itself sends something else than it should."""
    joints = len(scene.skeleton.joints)

    def carry(way: Traffic, payload: bytes) -> Sequence[Delivery]:
        if way is Traffic.COMMAND:
            payload = encode(change(decode(payload, Command, joints)))
        return ((0, payload),)

    scene.inject.carry = carry


def _not_numbers(scene: Scene) -> None:
    def command() -> None:
        for value in (np.nan, np.inf, -np.inf):
            bad = turned(scene.newest(), value)
            with np.errstate(invalid="ignore"):
                scene.command(encode(bad))
            scene.command_decoded(bad)
            scene.command_decoded(replace(turned(scene.newest()), velocity_rad_s=bad.position_rad))

    scene.each_period = command


def _huge(scene: Scene) -> None:
    def command() -> None:
        for value in (1e30, -1e30, 12.6):
            scene.command(encode(turned(scene.newest(), value)))

    scene.each_period = command


def _negative_zeros(scene: Scene) -> None:
    def minus(command: Command) -> Command:
        position, velocity = command.position_rad + 0.0, command.velocity_rad_s + 0.0
        position[position == 0.0] = velocity[velocity == 0.0] = -0.0
        return replace(command, position_rad=position, velocity_rad_s=velocity)

    _change_commands(scene, minus)


def _largest(scene: Scene) -> None:
    every = np.ones(len(scene.skeleton.joints))
    _change_commands(scene, lambda c: replace(c, position_rad=12.5 * every, velocity_rad_s=99.0 * every))


def _jump(scene: Scene) -> None:
    lower, upper = scene.skeleton.lower_rad, scene.skeleton.upper_rad
    far = np.where(scene.newest().position_rad > 0.5 * (lower + upper), lower, upper)
    _change_commands(scene, lambda command: replace(command, position_rad=far))


def _jumps(scene: Scene) -> None:
    ends = [scene.skeleton.lower_rad, scene.skeleton.upper_rad]
    _change_commands(scene, lambda command: replace(command, position_rad=ends[command.sequence % 2]))


VALUES = (
    goes_on(
        name="values that are not numbers",
        done="NaN and infinities as angles and as velocities, with the operator's lease.",
        robot="Follows the sound commands; takes none of the others.",
        person="Replace the program that sends them.",
        act=_not_numbers,
        strays_deg=0.0, refused_by={"codec", "valid"}, held_by={"valid"},
    ),
    goes_on(
        name="huge values",
        done="Angles beyond two turns, up to 1e30 rad, with the operator's lease.",
        robot="Follows the sound commands; takes none of the others.",
        person="Replace the program that sends them.",
        act=_huge,
        strays_deg=0.0, refused_by={"codec"},
    ),
    goes_on(
        name="negative zeros",
        done="Every zero comes with a minus.",
        robot="Follows: it is the same number.",
        person=NOTHING,
        act=_negative_zeros,
        strays_deg=0.0,
    ),
    follows_limited(
        name="largest values that a message can carry",
        done="The master asks for 12.5 rad at 99 rad/s of every joint, in command after command.",
        robot="Cannot know that this is not meant: goes to the ends of its ranges, slowly.",
        person=LET_GO,
        act=_largest,
        held_by={"position", "velocity", "acceleration"},
    ),
    follows_limited(
        name="valid but impossible jump",
        done="From one command to the next every joint is asked to be at the far end of its range.",
        robot="Cannot know that this is not meant: goes there, slowly.",
        person=LET_GO,
        act=_jump,
        held_by={"velocity", "acceleration"},
    ),
    follows_limited(
        name="a jump with every command",
        done="Each command asks for the other end of every joint's range than the one before.",
        robot="Cannot know that this is not meant: goes to and fro, slowly.",
        person=LET_GO,
        act=_jumps,
        held_by={"velocity", "acceleration"},
    ),
)  # fmt: skip
