"""How does each strategy follow over each link? The whole way on the virtual clock, judged as the demo is.

`python -m deploy.following` prints the table of slave/track/README.md, in some minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import Annotated

import typer

from common.clock import NS_PER_MS
from common.messages import Action
from deploy.judge import Motion, MovedSeries, motion
from deploy.virtual import VirtualRun, World

STRATEGIES = ("hold", "interpolate", "predict")
LINKS = {
    "lan": World(),
    "4g": World(one_way_ns=30 * NS_PER_MS, jitter_ns=10 * NS_PER_MS, loss=0.005),
    "50 ms": World(one_way_ns=50 * NS_PER_MS),
    "80 ms": World(one_way_ns=80 * NS_PER_MS),
    "intercontinental": World(one_way_ns=120 * NS_PER_MS, jitter_ns=8 * NS_PER_MS, loss=0.005),
    "150 ms": World(one_way_ns=150 * NS_PER_MS),
}
SETTLE_S = 15.0


@dataclass(frozen=True, slots=True)
class Followed:
    """One run: how the robot followed, and what the guard had to do."""

    motion: Motion | None
    run: VirtualRun


def engaged(world: World) -> VirtualRun:
    """A run whose robot has aligned and tracks. Raises RuntimeError with the reason where it does not."""
    run = VirtualRun(world)
    run.run(
        10.0, until=lambda: bool(run.commands and run.commands[-1].valid.all() and run.commands[-1].lease)
    )
    run.run(1.0)
    reply = run.ask(Action.ENGAGE)
    if not reply.done:
        raise RuntimeError(reply.text)
    run.run(SETTLE_S, until=lambda: run.slave.guard.state == "track")
    if run.slave.guard.state != "track":
        raise RuntimeError(run.slave.guard.reason)
    return run


def moved(run: VirtualRun) -> MovedSeries:
    """The encoders' series, its stamps on the suit's clock, which is the master's."""
    for state in run.states:
        run.trace.add(state)
    series = run.trace.moved()
    offset_ns = run.slave_ns - run.now_ns
    return replace(series, encoder_ns=series.encoder_ns - offset_ns)


def follow(world: World, strategy: str, seconds: float) -> Followed:
    """Track for some time by a strategy, and be judged."""
    overrides = {**world.overrides}
    overrides["slave"] = [*overrides.get("slave", ()), f'track.strategy="{strategy}"']
    run = engaged(replace(world, overrides=overrides))
    run.run(seconds)
    return Followed(motion(run.trace.truth(), moved(run), run.trace.joint_names), run)


def main(
    seconds: Annotated[float, typer.Option(help="How long each run tracks.")] = 32.0,
    seed: Annotated[int, typer.Option(help="Of jitter and loss.")] = 1,
) -> None:
    """Print how each strategy follows over each link."""
    row = "{:17} {:12} {:>7} {:>7} {:>8} {:>10} {:>10} {:>6}\n"
    head = ("link", "strategy", "RMSE °", "/ hold", "lag ms", "aligned °", "roughness", "holds")
    sys.stdout.write(row.format(*head))
    for name, world in LINKS.items():
        hold_deg = 0.0
        for strategy in STRATEGIES:
            done = follow(replace(world, link_seed=seed), strategy, seconds)
            m = done.motion
            losses = sum(done.run.slave.guard.counters.losses.values())
            if m is None:
                sys.stdout.write(row.format(name, strategy, "-", "-", "-", "-", "-", losses))
                continue
            hold_deg = m.rmse_deg if strategy == "hold" else hold_deg
            figures = (m.rmse_deg, m.rmse_deg / hold_deg, m.lag_ms, m.aligned_rmse_deg, m.roughness)
            cells = ["-" if f is None else f"{f:.2f}" for f in figures]
            sys.stdout.write(row.format(name, strategy, *cells, losses))
            sys.stdout.flush()


if __name__ == "__main__":
    typer.run(main)
