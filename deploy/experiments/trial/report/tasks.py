"""Care tasks and what each needs of a setup: read from a TOML file and checked."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigMistake
from deploy.experiments.trial.cell.figures import BY_NAME

TASKS = Path(__file__).with_name("tasks.toml")
"""The tasks that come with the project."""


class Criterion(Section):
    """One figure's part in a task's score."""

    figure: str
    weight: float = Field(gt=0.0)
    good: float
    """Scores 100, as does whatever is better."""
    bad: float
    """Scores 0, as does whatever is worse."""

    def score(self, value: float) -> float:
        """0 to 100, linear from `bad` to `good`, whichever of the two is the larger."""
        share = (value - self.bad) / (self.good - self.bad)
        return 100.0 * min(1.0, max(0.0, share))


class Task(Section):
    """One care task."""

    name: str
    title: str
    needs: str
    """What the task needs, as a sentence."""
    must: dict[str, float] = Field(default_factory=dict)
    """Figures and the most each may be in any repeat."""
    criteria: list[Criterion] = Field(min_length=1)


class Tasks(Section):
    """The whole file."""

    tasks: list[Task] = Field(min_length=1)

    def mistakes(self) -> list[ConfigMistake]:
        """Figures that do not exist, scales without a length."""
        found = []
        for i, task in enumerate(self.tasks):
            named = {f"tasks.{i}.must.{name}": name for name in task.must}
            named |= {f"tasks.{i}.criteria.{k}.figure": c.figure for k, c in enumerate(task.criteria)}
            found += [
                ConfigMistake(key, name, f"one of {', '.join(BY_NAME)}")
                for key, name in named.items()
                if name not in BY_NAME
            ]
            found += [
                ConfigMistake(f"tasks.{i}.criteria.{k}.bad", c.bad, "another value than good")
                for k, c in enumerate(task.criteria)
                if c.good == c.bad
            ]
        return found


def load_tasks(path: Path = TASKS) -> list[Task]:
    """Raises ConfigError, one line a mistake."""
    return load_config(path, Tasks).tasks
