"""Keeps the messages that the observer receives, stretch by stretch."""

from __future__ import annotations

from common.wire.messages import Command, RobotState, Statistics, Truth
from deploy.experiments.trial.cell.recording import CellMessages
from deploy.harness.observer import Heard


class MessageKeeper:
    """Every message since the last `take`."""

    def __init__(self) -> None:
        self._heard: list[Heard] = []

    def hear(self, message: Heard) -> None:
        """Keep one."""
        self._heard.append(message)

    def take(self) -> CellMessages:
        """All of them by kind, in the order they came; then it begins anew."""
        heard, self._heard = self._heard, []
        return CellMessages(
            commands=[m for m in heard if isinstance(m, Command)],
            states=[m for m in heard if isinstance(m, RobotState)],
            truth=[m for m in heard if isinstance(m, Truth)],
            statistics=[m for m in heard if isinstance(m, Statistics)],
        )
