"""How does each strategy follow over each link? One run a link on the virtual clock, and its replays.

`python -m deploy.experiments.following` prints the table of slave/track/README.md, in some minutes.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from deploy.measure.replay import Comparison, arrivals, compare
from deploy.sim.network.profile import Profile, Way, load_profile
from deploy.sim.world.world import VirtualWorld, WorldSettings

PROFILES = ("lan", "4g", "intercontinental")
DELAYS_MS = (2, 30, 50, 80, 150)
LOSS_PERCENT = 2.0
SLOW = ("guard.max_age_s=0.5",)
"""Half a round trip and the bound of the clocks' offset, which is as much, must fit into it."""


def links() -> dict[str, Profile]:
    """What is measured: shipped profiles, then plain delays, with and without loss."""
    found = {name: load_profile(name) for name in PROFILES}
    for ms in DELAYS_MS:
        found[f"{ms} ms"] = Profile(both=Way(delay_ms=ms))
        found[f"{ms} ms, {LOSS_PERCENT:g} %"] = Profile(both=Way(delay_ms=ms, loss_percent=LOSS_PERCENT))
    return found


def compared(network: Profile, seed: int, seconds: float) -> Comparison | None:
    """Track over a link, then replay the commands by each strategy; None where the run is too short."""
    # one clock: the replay applies no offset
    world = VirtualWorld(
        WorldSettings(
            network=network, network_seed=seed, slave_ahead_ns=0, slave_drift_ppm=0.0,
            overrides={"slave": [*SLOW]},
        )
    )  # fmt: skip
    world.engage()
    world.run(seconds)
    accepted = arrivals(world.commands, world.states)
    return compare(world.trace.truth(), world.moved(), accepted, world.slave_config)


def main(
    seconds: Annotated[float, typer.Option(help="How long each run tracks.")] = 17.0,
    seed: Annotated[int, typer.Option(help="Random seed for delay and loss.")] = 1,
    only: Annotated[str, typer.Option(help="Measure only the links whose names begin with this.")] = "",
) -> None:
    """Print how each strategy follows over each link, as the table of slave/track/README.md."""
    row = "| {:16} | {:11} | {:>6} | {:>8} | {:>6} | {:>9} | {:>9} |\n"
    head = ("link", "strategy", "RMSE °", "/ latest", "lag ms", "aligned °", "roughness")
    sys.stdout.write(row.format(*head) + row.format(*("---" for _ in head)))
    for name, profile in links().items():
        if not name.startswith(only):
            continue
        found = compared(profile, seed, seconds)
        if found is None:
            raise SystemExit(f"{name}: the robot did not track for long enough to be judged")
        for strategy, m in found.replayed.items():
            over_latest = m.rmse_deg / found.replayed["latest"].rmse_deg
            values = (m.rmse_deg, over_latest, m.lag_ms, m.aligned_rmse_deg, m.roughness)
            cells = ("-" if v is None else f"{v:.{d}f}" for v, d in zip(values, (2, 2, 0, 2, 1), strict=True))
            sys.stdout.write(row.format(name, strategy, *cells))
            sys.stdout.flush()


if __name__ == "__main__":
    typer.run(main)
