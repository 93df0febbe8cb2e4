"""Somebody in the robot's way, and loads that its model does not know."""

from __future__ import annotations

import numpy as np

from common.clock import to_s
from deploy.harness.faults.fault import ENGAGE
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.touched import MetPart, body_of, hand, wrist
from deploy.harness.faults.virtual import VirtualFault, holds
from deploy.sim.patient.patient import in_the_way
from deploy.sim.patient.robot import TouchingRobot
from slave.guard import State

WITH_PATIENT = Setting(patient=True)
NOTICED_S = 0.08
"""From the touch: a slow hand first has to press."""
BACK_S = 1.0
"""Braked, and gone back until nothing pushes and some centimetres more."""
UNDECLARED_KG = 4.0
LOADED = "A bag of {kg:g} kg, not declared in the robot's file, is hung over a forearm."
PERSON = "Free the person, and see to him. Then engage; the robot goes slowly to the operator's posture."


def _robot(scene: Scene) -> TouchingRobot:
    robot = scene.run.touching
    assert robot is not None
    return robot


def _meets(scene: Scene, part: MetPart | None, *, clamped: bool) -> None:
    robot = _robot(scene)
    assert part is not None
    robot.segment, robot.local_m = part.body, np.array(part.at_m)
    patient = robot.patient = in_the_way(*robot.point(), clamped=clamped)

    def watch() -> None:
        if to_s(scene.run.now_ns - scene.fault_ns) > BACK_S and patient.force_n > 0.0:
            scene.granted.append("a hand that goes on pushing after the stop")

    scene.each_period = watch


def _slow(scene: Scene) -> None:
    _meets(scene, hand(scene.skeleton), clamped=False)


def _free(scene: Scene) -> None:
    _meets(scene, wrist(scene.skeleton), clamped=False)


def _clamped(scene: Scene) -> None:
    _meets(scene, wrist(scene.skeleton), clamped=True)


def takes_up(scene: Scene, kg: float = UNDECLARED_KG) -> None:
    """The forearm carries so much more."""
    body = body_of(scene.skeleton, "right_forearm")
    assert body is not None
    _robot(scene).load(body, kg)


CONTACT: tuple[VirtualFault, ...] = (
    holds(
        name="contact, slow",
        done="The robot moves slowly to the operator's posture; its hand meets a person who gives way.",
        robot="A protective stop; the hand goes back the way it came until it is free, and 3 cm more.",
        person=PERSON,
        act=_slow, begins=State.ALIGN, setting=WITH_PATIENT,
        reacts_s=0.3, stands_s=0.3 + BACK_S, yields=True, held_by={"contact"},
    ),
    holds(
        name="contact, fast",
        done="In the middle of the reach the hand meets a person who can give way.",
        robot="A protective stop; the hand goes back the way it came until it is free, and 3 cm more.",
        person=PERSON,
        act=_free, setting=WITH_PATIENT,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BACK_S, yields=True, held_by={"contact"},
    ),
    holds(
        name="contact, clamped",
        done="In the middle of the reach the hand presses a person against a wall.",
        robot="A protective stop; the hand goes back the way it came until it is free, and 3 cm more.",
        person=PERSON,
        act=_clamped, setting=WITH_PATIENT,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BACK_S, yields=True, held_by={"contact"},
    ),
    holds(
        name="payload wrong",
        done=LOADED.format(kg=UNDECLARED_KG),
        robot="Takes the weight for somebody who pulls: a protective stop, and engage is refused until the "
        "load is gone or declared.",
        person=f"Take it off, or declare it in [servos.payload]. {ENGAGE}",
        act=takes_up, setting=WITH_PATIENT,
        reacts_s=0.3, stands_s=2.0, yields=True, held_by={"contact"},
    ),
)  # fmt: skip
