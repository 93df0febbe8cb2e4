"""A run on the virtual clock, judged by a node on the simulated hand; faults may be planted."""

from __future__ import annotations

from collections.abc import Mapping

from common.clock import NS_PER_S
from common.clock_sync import UNKNOWN_NS
from deploy.measure.proof import Claims, ProofRow, prove
from deploy.sim.network.profile import load_profile
from deploy.sim.world.hand_node import ProvedWorld
from deploy.sim.world.world import VirtualWorld, WorldSettings

SETTLE_S = 1.0
LONG_LINE = ("guard.max_age_s=0.5",)
"""Half a round trip and the offset's bound, which is as much, must fit into it."""


def simulate(network: str, seconds: float, plant: Mapping[str, int], seed: int = 1) -> ProvedWorld:
    """Track for some time. Raises ConfigError for an unknown network, TandemError if it never tracks."""
    settings = WorldSettings(
        network=load_profile(network), network_seed=seed, overrides={"slave": [*LONG_LINE]}
    )
    proved = ProvedWorld(VirtualWorld(settings), plant=dict(plant))
    proved.world.engage()
    proved.world.run(SETTLE_S)
    proved.forget()
    proved.world.run(seconds)
    return proved


def judge(proved: ProvedWorld) -> list[ProofRow]:
    """What the node says, beside what the slave's stamps claim."""
    return prove(proved.motions(), claims_of(proved))


def claims_of(proved: ProvedWorld) -> Claims:
    """What tandem itself says of the run."""
    world = proved.world
    total = world.slave.traffic.journeys.budget.total()
    offset = world.slave.clock.estimate(world.slave_ns)
    assert offset.bound_ns < UNKNOWN_NS
    late_ns = [offset.local_ns(one.eye_ns) - one.stamp_ns for one in proved.motions().pictures]
    scene_ms = 1e3 * sum(late_ns) / len(late_ns) / NS_PER_S if late_ns else None
    return Claims(total.mean, 1e3 * world.slave_config.servos.bus_lag_s, scene_ms)
