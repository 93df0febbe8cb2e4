"""Scenes brought to a state once and copied for every trial that begins so."""

from __future__ import annotations

from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.sim.world.copy import copied
from slave.guard import State


class BegunScenes:
    """By setting and state. To reach a state takes as long as a trial; a copy takes a tenth of that."""

    def __init__(self) -> None:
        self._scenes: dict[tuple[Setting, State], Scene] = {}

    def begun(self, setting: Setting, state: State) -> Scene:
        """A scene in this state, of one's own. Raises TandemError where it does not get there."""
        at = setting, state
        if at not in self._scenes:
            scene = Scene(setting)
            scene.to(state)
            self._scenes[at] = scene
        return copied(self._scenes[at])
