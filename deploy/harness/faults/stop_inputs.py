"""Faults of the robot's own emergency stop inputs: a button is pressed, a wire breaks, a source vanishes."""

from __future__ import annotations

from collections.abc import Callable

from common.clock import NS_PER_MS
from common.wire.messages import Action
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S
from deploy.harness.faults.scene import RESET_KEY, Scene
from deploy.harness.faults.virtual import stops
from slave.guard import State
from slave.guard.body import Body
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.rule import StopInputs
from slave.stop_inputs.source import Level

BUTTON = EstopConfig(
    inputs=[StopInputConfig(name="red button", source="gpio", line="ESTOP", bias="pull_down")]
)
"""A contact that the button opens, from the supply to a line that is pulled down: on while it is closed."""
_TAP_NS = 30 * NS_PER_MS
_BOUNCE_NS = 15 * NS_PER_MS
MEND = (
    "Mend the wire or the adapter that the message names; then reset with the key at the robot, and engage."
)

Told = Callable[[int, int], Level]
"""What the input's source tells: now, and the time since the fault, ns."""


def _wired(told: Told, *, cut: bool = False, reset: bool = True) -> Callable[[Scene], None]:
    """From the fault on the robot's only input tells this. Meanwhile its people try to go on in vain.

    `cut`: the link fails at the same moment. `reset`: a reset with the key must be refused too.
    """

    def act(scene: Scene) -> None:
        rule, began_ns = StopInputs(BUTTON), scene.run.slave_ns

        def body() -> Body:
            now_ns = scene.run.slave_ns
            return Body(stops=rule.step(now_ns, [told(now_ns, now_ns - began_ns)]))

        def others() -> None:
            if scene.guard.state is not State.ESTOP:
                return
            scene.refuses_to_engage("the e-stop is latched")
            if reset and scene.run.ask(Action.RESET, RESET_KEY).done:
                scene.granted.append("a reset, though the contact is open,")

        scene.inject.body, scene.each_period = body, others
        if cut:
            scene.inject.carry = lambda *_: ()

    return act


def _open(now_ns: int, _: int) -> Level:
    return Level(now_ns, False)


def _tapped(now_ns: int, since_ns: int) -> Level:
    return Level(now_ns, since_ns >= _TAP_NS)


def _loose(now_ns: int, since_ns: int) -> Level:
    """A wire that touches now and then."""
    return Level(now_ns, since_ns // _BOUNCE_NS % 3 == 2)


def _vanished(now_ns: int, _: int) -> Level:
    return Level(now_ns, None, "No such device")


def _silent(now_ns: int, since_ns: int) -> Level:
    return Level(now_ns - since_ns, True)


_PERSON = "Make sure that all is well, release the button, reset with the key at the robot, then engage."
_SILENT_S = BUTTON.silent_s + AT_ONCE_S
STOP_INPUTS = (
    stops(
        name="stop button",
        done="Somebody at the robot presses its red button and leaves it pressed; others try to go on, with "
        "the key too.",
        robot="Brakes and stands; names the button. No reset while it is pressed.",
        person=_PERSON,
        act=_wired(_open),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop button tapped",
        done="The button is pressed for 30 ms only.",
        robot="The same: it stays stopped.",
        person=_PERSON,
        act=_wired(_tapped, reset=False),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop button while the link is down",
        done="The button is pressed in the moment in which the link fails, so that no operator is there.",
        robot="The same: the button needs nobody.",
        person=_PERSON,
        act=_wired(_open, cut=True),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop button before an engage",
        done="The button is pressed while nobody is engaged.",
        robot="Stands, and cannot be engaged.",
        person=_PERSON,
        act=_wired(_open),
        begins=State.HOLD, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop wire broken",
        done="The wire of a normally closed button breaks, and its ends touch now and then.",
        robot="Brakes and stands, as for the button: it cannot tell them apart.",
        person=MEND,
        act=_wired(_loose),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop input unplugged",
        done="The adapter that reads the button is unplugged.",
        robot="Brakes and stands; says what is missing.",
        person=MEND,
        act=_wired(_vanished),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    stops(
        name="stop input silent",
        done="The adapter, or the drive that tells the button's state, hangs and tells nothing more.",
        robot="Brakes and stands, once nothing has been heard for 0.2 s.",
        person=MEND,
        act=_wired(_silent),
        reacts_s=_SILENT_S, stands_s=_SILENT_S + BRAKED_S,
    ),
)  # fmt: skip
