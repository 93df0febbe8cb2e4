from __future__ import annotations

import io
import json

import pytest
from rich.console import Console

from deploy.experiments.accuracy.papers.figures import Experiment, PaperValue, gather, run_experiment
from deploy.experiments.accuracy.papers.table import experiment_table, experiment_tree
from deploy.harness.workers import run_each


def made_up(seed: int) -> list[PaperValue]:
    return [
        PaperValue("error", "°", (0.1 * seed, 0.2), paper=1.5, target=0.35),
        PaperValue("spread", "°", (float(seed),)),
    ]


MADE_UP = Experiment("X", "made up", made_up, ("a note",))


def test_mean_and_worst_are_over_seeds_and_sides() -> None:
    error, spread = gather({seed: made_up(seed) for seed in (1, 2, 3)})
    assert error.mean == pytest.approx((0.1 + 0.2 + 0.3 + 3 * 0.2) / 6)
    assert error.worst == pytest.approx(0.3)
    assert error.outcome == "passed"
    assert spread.outcome is None, "nothing is asked of it"


def test_one_bad_seed_misses_the_target() -> None:
    assert gather({seed: made_up(seed) for seed in (1, 2, 3, 4)})[0].outcome == "failed"


@pytest.mark.parametrize("values", [(), (float("nan"),)])
def test_a_seed_that_tells_nothing_has_missed(values: tuple[float, ...]) -> None:
    rows = gather({1: made_up(1), 2: [PaperValue("error", "°", values, 1.5, 0.35)]})
    assert rows[0].outcome == "failed"


def test_other_processes_find_the_same() -> None:
    work = [(MADE_UP, seed) for seed in (1, 2)]
    assert dict(run_each(run_experiment, work, jobs=2)) == dict(run_each(run_experiment, work, jobs=1))


def test_table_and_report_name_the_paper_s_figure_and_ours() -> None:
    rows = gather({seed: made_up(seed) for seed in (1, 4)})
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(experiment_table(MADE_UP, rows))
    text = console.export_text()
    assert "1.5" in text
    assert "0.4" in text
    assert "failed" in text
    assert "a note" in text
    tree = json.loads(json.dumps(experiment_tree(MADE_UP, rows)))
    assert tree["figures"][0] == {
        "name": "error",
        "unit": "°",
        "paper": 1.5,
        "target": 0.35,
        "mean": pytest.approx(0.225),
        "worst": pytest.approx(0.4),
        "outcome": "failed",
        "by_seed": {"1": [0.1, 0.2], "4": [0.4, 0.2]},
    }
