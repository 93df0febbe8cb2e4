"""Faults of the hosts' clocks; and an emergency stop in each state of the guard."""

from __future__ import annotations

from collections.abc import Callable

from common.clock import NS_PER_S
from common.wire.messages import Action
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S, ENGAGE, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.virtual import holds, stops
from slave.guard import State

HOUR_NS = 3_600 * NS_PER_S


def _stepped(master_ns: int = 0, slave_ns: int = 0) -> Callable[[Scene], None]:
    def act(scene: Scene) -> None:
        scene.inject.master_stepped_ns, scene.inject.slave_stepped_ns = master_ns, slave_ns

    return act


def _estop(scene: Scene) -> None:
    scene.run.ask(Action.ESTOP, operator="a visitor")

    def others() -> None:
        for action in (Action.ENGAGE, Action.RESET):
            scene.ask(action, scene.run.master_config.operator.name)

    scene.each_period = others


CLOCKS = (
    holds(
        name="master's clock an hour ahead",
        done="The clock that stamps the commands is set ahead by an hour.",
        robot="Takes no command from the future; brakes and stands. "
        "It measures the clock anew within a second.",
        person=ENGAGE,
        act=_stepped(master_ns=HOUR_NS),
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S,
        refused_by={"future"}, held_by={"future", "clock"},
    ),
    holds(
        name="master's clock an hour back",
        done="The same clock is set back by an hour.",
        robot="Takes no command so old; brakes and stands.",
        person=ENGAGE,
        act=_stepped(master_ns=-HOUR_NS),
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, refused_by={"age"}, held_by={"age"},
    ),
    holds(
        name="robot's clock an hour ahead",
        done="The clock by which the robot counts its own time-outs is set ahead by an hour.",
        robot="Takes everything for an hour late; brakes at once and stands.",
        person=ENGAGE,
        act=_stepped(slave_ns=HOUR_NS),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by={"command", "lease", "encoder", "age"},
    ),
    holds(
        name="robot's clock an hour back",
        done="The same clock is set back by an hour.",
        robot="Sees that its time went back; brakes at once and stands.",
        person=ENGAGE,
        act=_stepped(slave_ns=-HOUR_NS),
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        held_by={"command", "lease", "encoder", "future"},
    ),
)  # fmt: skip

ESTOPS = tuple(
    stops(
        name=f"emergency stop in {state}",
        done="A visitor asks for an emergency stop; then the operator tries to go on, without the key.",
        robot=does,
        person="Make sure that all is well, reset with the key at the robot, then engage.",
        act=_estop,
        begins=state, reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    )
    for state, does in {
        State.BOOT: "Has not begun to move, and will not: nothing is written to the drives.",
        State.HOLD: "Stands already, and stays.",
        State.ALIGN: "Brakes and stands.",
        State.TRACK: "Brakes and stands.",
        State.ESTOP: "Stands already; the second stop changes nothing.",
    }.items()
)  # fmt: skip
