"""Which parts of a run are done and what they found, in a file: a run that was stopped goes on from there."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, fields
from pathlib import Path

from common.errors import ConfigError, ConfigMistake
from deploy.experiments.collisions.report import CollisionReport
from deploy.report.output import write_json


class RunProgress:
    """Parts of a run; `run` names everything that must be the same for them to add up."""

    def __init__(self, run: dict[str, object], file: Path | None) -> None:
        self._run, self._file = run, file
        self.done: set[int] = set()
        self.found = CollisionReport()

    def resume(self) -> None:
        """Take what the file has, if there is one. Raises ConfigError where it is of another run."""
        if self._file is None or not self._file.exists():
            return
        try:
            tree = json.loads(self._file.read_text("utf-8"))
            run, done, found = tree["run"], set(map(int, tree["parts"])), tree["found"]
            found = CollisionReport(**{f.name: found[f.name] for f in fields(CollisionReport)})
        except (ValueError, KeyError, TypeError, OSError) as error:
            raise self._refused(f"cannot be read: {error}") from None
        for key, value in self._run.items():
            if run.get(key) != value:
                raise self._refused(f"has {key} {run.get(key)!r}, and this run has {value!r}")
        found.kinds = Counter(found.kinds)
        self.done, self.found = done, found

    def _refused(self, why: str) -> ConfigError:
        assert self._file is not None
        expected = "the file of a run with the same settings by the same code, or a new name"
        return ConfigError(self._file, [ConfigMistake("--resume", why, expected)])

    def add(self, part: int, found: CollisionReport) -> None:
        """A part is done; the file has it from now on."""
        self.done.add(part)
        self.found.add(found)
        if self._file is not None:
            whole = self._file.with_suffix(".new")
            write_json(whole, {"run": self._run, "parts": sorted(self.done), "found": as_tree(self.found)})
            whole.replace(self._file)


def as_tree(found: CollisionReport) -> dict[str, object]:
    """For JSON."""
    return {**asdict(found), "kinds": dict(found.kinds)}
