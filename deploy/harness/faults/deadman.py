"""Faults of what the operator holds: a pedal that is released, unplugged or stuck; a clutch; a CAN button."""

from __future__ import annotations

from collections.abc import Callable

from common.wire.messages import Action
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S, ENGAGE, NOTICED_S, Reaction
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.virtual import VirtualFault, holds
from slave.guard import State

PEDAL = 'operator.deadman={source="pedal",device="FootSwitch",key="KEY_B"}'
CLUTCH = 'operator.clutch={source="pedal",device="FootSwitch",key="KEY_C"}'
BUTTON = 'operator.deadman={source="can",bus="suit",signal="DEADMAN"}'
WITH_PEDAL, WITH_BUTTON = Setting(master=(PEDAL,)), Setting(master=(BUTTON,))
WITH_CLUTCH = Setting(master=(PEDAL, CLUTCH))
TOLD_S = 0.02
"""A button's frame tells it within this."""
SILENT_S = 0.1 + TOLD_S
"""`timeout_s` of the button, and the next look."""
PRESS = "Press the pedal and hold it, then engage; the robot goes slowly to the operator's posture."

Acts = Callable[[Scene], None]


def _refusing(act: Acts) -> Acts:
    """From then on an engage must be refused."""

    def acts(scene: Scene) -> None:
        def refuses() -> None:
            if scene.guard.state is State.HOLD:
                scene.ask(Action.ENGAGE, scene.guard.operator)

        act(scene)
        scene.each_period = refuses

    return acts


def _let_go(name: str) -> Acts:
    def act(scene: Scene) -> None:
        scene.run.hands.let_go(name, scene.run.master_ns)
        scene.run.look()

    return act


def _tap(scene: Scene) -> None:
    """Released and pressed again before anything else happens."""
    scene.run.hands.let_go("deadman", scene.run.master_ns)
    scene.run.hands.press("deadman", scene.run.master_ns)
    scene.run.look()


def _unplugged(scene: Scene) -> None:
    pedal = scene.run.hands.keys["deadman"]
    pedal.lost("/dev/input/event5 has gone")
    scene.run.look()
    # plugged in again, and the foot is still on it
    scene.undo = lambda: pedal.read(True, scene.run.master_ns)


def _stuck(scene: Scene) -> None:
    """As it is when the master starts: the device is opened, and its key is down."""
    _unplugged(scene)
    scene.undo()
    scene.run.run(0.2)


def _clutch_for_a_moment(scene: Scene) -> None:
    _let_go("clutch")(scene)
    scene.undo = lambda: scene.run.hands.press("clutch", scene.run.master_ns)


def _clutch_then_link(scene: Scene) -> None:
    """The link fails while the clutch is released, and is back when it has been pressed."""
    _let_go("clutch")(scene)
    scene.run.run(0.1)
    usual = scene.inject.carry
    scene.inject.carry = lambda *_: ()

    def back() -> None:
        scene.inject.carry = usual
        scene.run.hands.press("clutch", scene.run.master_ns)

    scene.undo = back


def _bus_off(scene: Scene) -> None:
    scene.inject.suit_heard = False


def _node_frozen(scene: Scene) -> None:
    scene.run.hands.frozen = True


DEADMAN = (
    holds(
        name="pedal released",
        done="The operator takes the foot off the deadman's pedal.",
        robot="Brakes and stands. The master tells it at once, not with the next posture.",
        person=PRESS,
        act=_refusing(_let_go("deadman")),
        setting=WITH_PEDAL, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
    holds(
        name="pedal released for a moment",
        done="The foot comes off the pedal and is back at once: shorter than one command.",
        robot="Brakes and stands, though the pedal is held again.",
        person=ENGAGE,
        act=_tap,
        setting=WITH_PEDAL, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
    holds(
        name="pedal unplugged",
        done="The pedal's plug comes out. It is put in again 1 s later with the foot still on the pedal.",
        robot="Brakes and stands. Until the pedal has been released and pressed, engage is refused.",
        person="Release the pedal. " + PRESS,
        act=_refusing(_unplugged),
        lasts_s=1.0, setting=WITH_PEDAL, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
    holds(
        name="pedal stuck from the start",
        done="The pedal is taped down, or stuck, when the master opens it.",
        robot="Stands. Engage is refused until the pedal has been seen released, then pressed.",
        person="Free the pedal. " + PRESS,
        act=_refusing(_stuck),
        begins=State.HOLD, setting=WITH_PEDAL, stands_s=AT_ONCE_S,
        refused_by={"deadman"},
    ),
    VirtualFault(
        name="clutch released",
        done="The operator releases the clutch, holds the deadman, and walks on.",
        reaction=Reaction.WAITS,
        robot="Brakes and stands while the operator repositions.",
        person="Press the clutch again; the robot goes slowly to the operator's posture.",
        act=_let_go("clutch"),
        ends=State.CLUTCH, setting=WITH_CLUTCH, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    ),
    VirtualFault(
        name="clutch released and pressed",
        done="The operator releases the clutch for 0.6 s in the middle of a reach.",
        reaction=Reaction.LIMITED,
        robot="Brakes and stands, then goes slowly to the operator's posture; no engage is needed.",
        person="Nothing.",
        act=_clutch_for_a_moment,
        lasts_s=0.6, ends=State.ALIGN, setting=WITH_CLUTCH,
    ),
    holds(
        name="link lost while the clutch is released",
        done="The link fails for 0.5 s while the clutch is released; then the clutch is pressed.",
        robot="Stands, and still stands when the link and the clutch are back.",
        person=ENGAGE,
        act=_clutch_then_link,
        lasts_s=0.5, setting=WITH_CLUTCH, reacts_s=0.1 + 0.08 + NOTICED_S, stands_s=AT_ONCE_S + BRAKED_S,
        held_by={"command"},
    ),
    holds(
        name="pedal released while the clutch is",
        done="The operator lets go of the deadman too, while the clutch is released.",
        robot="Stands. Pressing both again does not make it follow.",
        person=ENGAGE,
        act=lambda scene: (_let_go("clutch")(scene), _let_go("deadman")(scene))[0],
        setting=WITH_CLUTCH, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
    holds(
        name="bus of the deadman's button off",
        done="The bus between the master and the suit fails, on which the glove's button is told.",
        robot="Brakes and stands at once, as if the button was released.",
        person="Mend the bus, release the button. " + PRESS,
        act=_refusing(_bus_off),
        setting=WITH_BUTTON, reacts_s=TOLD_S, stands_s=TOLD_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
    holds(
        name="node of the deadman's button frozen",
        done="The button's node hangs; its controller repeats the last frame, in which it is pressed.",
        robot="Brakes and stands: a frame whose counter stands does not hold the deadman.",
        person="Start the node again, release the button. " + PRESS,
        act=_refusing(_node_frozen),
        setting=WITH_BUTTON, reacts_s=SILENT_S, stands_s=SILENT_S + BRAKED_S,
        refused_by={"deadman"}, held_by={"deadman"},
    ),
)  # fmt: skip
