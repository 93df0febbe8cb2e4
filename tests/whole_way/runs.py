"""A run on the virtual clock whose robot tracks, and how it followed."""

from __future__ import annotations

from dataclasses import replace

from deploy.experiments.following import SLOW
from deploy.measure import FollowedMotion, motion
from deploy.sim.world.world import VirtualWorld, WorldSettings


def engaged(settings: WorldSettings) -> VirtualWorld:
    """The robot has aligned and tracks."""
    run = VirtualWorld(settings)
    run.engage()
    return run


def judged(run: VirtualWorld) -> FollowedMotion:
    """How the robot followed so far."""
    found = motion(run.trace.truth(), run.moved(), run.trace.joint_names)
    assert found is not None
    return found


def follow(settings: WorldSettings, strategy: str, seconds: float) -> VirtualWorld:
    """Track for some time with a strategy."""
    overrides = {**settings.overrides}
    overrides["slave"] = [*SLOW, *overrides.get("slave", ()), f'track.strategy="{strategy}"']
    run = engaged(replace(settings, overrides=overrides))
    run.run(seconds)
    return run
