"""Faults of the link: what it may do to messages on their way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from common.clock import NS_PER_MS, to_ns
from deploy.harness.faults.fault import BRAKED_S, ENGAGE, NOTHING, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.virtual import goes_on, holds
from deploy.sim.world.injection import Delivery, FaultInjection, Traffic


def _cut(scene: Scene) -> None:
    scene.inject.carry = lambda way, payload: ()
    scene.undo = lambda: setattr(scene.inject, "carry", FaultInjection().carry)


def _held_back(scene: Scene) -> None:
    until_ns = scene.run.now_ns + to_ns(1.0)
    scene.inject.carry = lambda _, payload: ((max(0, until_ns - scene.run.now_ns), payload),)


def _reordered(scene: Scene) -> None:
    odd = False

    def carry(way: Traffic, payload: bytes) -> Sequence[Delivery]:
        nonlocal odd
        odd ^= way is Traffic.COMMAND
        return ((100 * NS_PER_MS if odd and way is Traffic.COMMAND else 0, payload),)

    scene.inject.carry = carry


def _late_ms(*delays_ms: int) -> Callable[[Scene], None]:
    """Every message arrives once for each delay."""

    def act(scene: Scene) -> None:
        scene.inject.carry = lambda _, payload: [(delay_ms * NS_PER_MS, payload) for delay_ms in delays_ms]

    return act


LINK = (
    holds(
        name="link cut",
        done="No message passes, either way, for 1 s; then the link is whole again.",
        robot="Brakes and stands. When the link is back it still stands.",
        person=ENGAGE,
        act=_cut,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, lasts_s=1.0, held_by={"command", "lease"},
    ),
    holds(
        name="link delayed 1 s, then released",
        done="All messages of one second arrive together at its end.",
        robot="Brakes and stands. What comes late moves nothing.",
        person=ENGAGE,
        act=_held_back,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, held_by={"command", "lease"},
    ),
    holds(
        name="link slow",
        done="From one moment to the next every message takes half a second.",
        robot="Takes no command older than `max_age_s` allows; brakes and stands.",
        person=ENGAGE,
        act=_late_ms(500),
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, refused_by={"age"}, held_by={"age", "command"},
    ),
    goes_on(
        name="packets reordered",
        done="Every second command arrives after its successor.",
        robot="Follows. It never goes back to an older command; "
        "half of them missing, it follows less exactly.",
        person=NOTHING,
        act=_reordered,
        strays_deg=10.0, refused_by={"sequence"}, held_by={"sequence"},
    ),
    goes_on(
        name="packets duplicated",
        done="Every message arrives three times: at once, 10 ms and 110 ms later.",
        robot="Follows as if each had come once.",
        person=NOTHING,
        act=_late_ms(0, 10, 110),
        strays_deg=0.0, refused_by={"sequence"}, held_by={"sequence"},
    ),
)  # fmt: skip
