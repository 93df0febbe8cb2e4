"""`tandem collisions --resume`: what a file of another run is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import ConfigError
from deploy.experiments.collisions.command import collisions
from deploy.harness import code_state


def test_a_file_that_other_code_began_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    collisions(motions=1, resume=file)
    collisions(motions=1, resume=file)
    monkeypatch.setattr(code_state, "code_state", lambda: "0123456789abcdef")
    with pytest.raises(ConfigError, match=r"has code '[0-9a-f]{16}', and this run has '0123456789abcdef'"):
        collisions(motions=1, resume=file)
