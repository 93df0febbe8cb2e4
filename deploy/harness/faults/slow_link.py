"""The link becomes slow while the robot follows: at once, and bit by bit."""

from __future__ import annotations

from common.clock import NS_PER_MS, to_ns
from deploy.harness.faults.fault import BRAKED_S, ENGAGE, NOTHING, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.virtual import goes_on, holds

FAST_MS, SLOW_MS = 20.0, 200.0
FAST = Setting(one_way_ms=FAST_MS)
SLOWS_S = 1.5


def _at_once(scene: Scene) -> None:
    later_ns = round((SLOW_MS - FAST_MS) * NS_PER_MS)
    scene.inject.carry = lambda _, payload: ((later_ns, payload),)


def _bit_by_bit(scene: Scene) -> None:
    begin_ns = scene.run.now_ns

    def later_ns() -> int:
        share = min(1.0, (scene.run.now_ns - begin_ns) / to_ns(SLOWS_S))
        return round(share * (SLOW_MS - FAST_MS) * NS_PER_MS)

    scene.inject.carry = lambda _, payload: ((later_ns(), payload),)


SLOW_LINK = (
    holds(
        name="link slows from 20 to 200 ms at once",
        done="From one moment to the next every message takes 200 ms instead of 20.",
        robot="The step itself is a silence of 0.26 s: it brakes and stands. Then it may be engaged: the "
        "guard's times follow the link, up to the site's ceilings, and `tandem status` tells them.",
        person=ENGAGE,
        act=_at_once,
        setting=FAST,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, held_by={"command"},
    ),
    goes_on(
        name="link slows from 20 to 200 ms bit by bit",
        done="Within 1.5 s the time of every message grows from 20 to 200 ms.",
        robot="Follows, later by as much.",
        person=NOTHING,
        act=_bit_by_bit,
        setting=FAST,
        strays_deg=15.0,
    ),
)  # fmt: skip
