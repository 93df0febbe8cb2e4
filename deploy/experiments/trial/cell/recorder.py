"""Keeps the messages that the observer receives, stretch by stretch."""

from __future__ import annotations

from deploy.experiments.trial.cell.recomputed import by_kind
from deploy.experiments.trial.cell.recording import CellMessages
from deploy.experiments.trial.cell.tape import NEITHER, CellTape
from deploy.harness.observer import Heard


class MessageKeeper:
    """Every message since the last `take`; a `tape` is told where its stretches begin."""

    def __init__(self, tape: CellTape | None = None) -> None:
        self._heard: list[Heard] = []
        self._tape = tape

    def hear(self, message: Heard) -> None:
        """Keep one."""
        self._heard.append(message)

    def take(self, then: str = NEITHER) -> CellMessages:
        """All of them by kind, in the order they came; then it begins anew with the stretch `then`."""
        heard, self._heard = self._heard, []
        if self._tape is not None:
            self._tape.stretch(then)
        return by_kind(heard)
