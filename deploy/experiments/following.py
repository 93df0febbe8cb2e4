"""How does each strategy follow over each link? The whole way on the virtual clock, judged as the demo is.

`python -m deploy.experiments.following` prints the table of slave/track/README.md, in some minutes.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from typing import Annotated

import typer

from common.wire.messages import Action
from deploy.measure import FollowedMotion, MovedSeries, motion
from deploy.sim.network.profile import Profile, Way, load_profile
from deploy.sim.world.whole_way import VirtualRun, World

STRATEGIES = ("latest", "interpolate", "predict")
PROFILES = ("lan", "4g", "intercontinental")
DELAYS_MS = (2, 30, 50, 80, 150)
LOSS_PERCENT = 2.0
SLOW = ("guard.max_age_s=0.5",)
"""Half a round trip and the bound of the clocks' offset, which is as much, must fit into it."""
SETTLE_S = 15.0
PATIENCE_S = 6
"""Over a slow link it takes some seconds until the clocks' offset is known."""


@dataclass(frozen=True, slots=True)
class Followed:
    """One run: how the robot followed, and what the guard had to do."""

    motion: FollowedMotion | None
    run: VirtualRun


def engaged(world: World) -> VirtualRun:
    """A run whose robot has aligned and tracks. Raises RuntimeError with the reason where it does not."""
    run = VirtualRun(world)
    run.run(
        10.0, until=lambda: bool(run.commands and run.commands[-1].valid.all() and run.commands[-1].lease)
    )
    for _ in range(PATIENCE_S):
        run.run(1.0)
        reply = run.ask(Action.ENGAGE)
        if reply.done:
            break
    else:
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


def links() -> dict[str, Profile]:
    """What is measured: shipped profiles, then plain delays, then those with loss."""
    plain = {f"{ms} ms": Profile(both=Way(delay_ms=ms)) for ms in DELAYS_MS}
    lossy = {
        f"{ms} ms, {LOSS_PERCENT:g} %": Profile(both=Way(delay_ms=ms, loss_percent=LOSS_PERCENT))
        for ms in DELAYS_MS
    }
    return {**{name: load_profile(name) for name in PROFILES}, **plain, **lossy}


def follow(world: World, strategy: str, seconds: float) -> Followed:
    """Track for some time by a strategy, and be judged."""
    overrides = {**world.overrides}
    overrides["slave"] = [*SLOW, *overrides.get("slave", ()), f'track.strategy="{strategy}"']
    run = engaged(replace(world, overrides=overrides))
    run.run(seconds)
    return Followed(motion(run.trace.truth(), moved(run), run.trace.joint_names), run)


def main(
    seconds: Annotated[float, typer.Option(help="How long each run tracks.")] = 32.0,
    seed: Annotated[int, typer.Option(help="Of delay and loss.")] = 1,
    only: Annotated[str, typer.Option(help="Links whose name begins so.")] = "",
) -> None:
    """Print how each strategy follows over each link, as the table of slave/track/README.md."""
    row = "| {:16} | {:11} | {:>6} | {:>6} | {:>6} | {:>9} | {:>9} |\n"
    head = ("link", "strategy", "RMSE °", "/ latest", "lag ms", "aligned °", "roughness")
    sys.stdout.write(row.format(*head) + row.format(*("---" for _ in head)))
    for name, profile in links().items():
        if not name.startswith(only):
            continue
        latest_deg = math.nan
        for strategy in STRATEGIES:
            m = follow(World(network=profile, network_seed=seed), strategy, seconds).motion
            if m is None:
                raise SystemExit(f"{name}, {strategy}: the robot did not track for long enough to be judged")
            latest_deg = m.rmse_deg if strategy == "latest" else latest_deg
            figures = (m.rmse_deg, m.rmse_deg / latest_deg, m.lag_ms, m.aligned_rmse_deg, m.roughness)
            digits = (2, 2, 0, 2, 1)
            cells = ("-" if f is None else f"{f:.{d}f}" for f, d in zip(figures, digits, strict=True))
            sys.stdout.write(row.format(name, strategy, *cells))
            sys.stdout.flush()


if __name__ == "__main__":
    typer.run(main)
