"""Paper A: the nurse's arms, the whole way on the virtual clock, as `tandem demo` judges them."""

from __future__ import annotations

from collections.abc import Sequence

from deploy.accuracy.papers.figures import Figure
from deploy.judge import Accuracy, accuracy
from deploy.judge.accuracy import SIDES
from deploy.judge.paper import ETA_PERCENT, TABLE_1
from deploy.virtual import VirtualRun, World

ETA_TARGET_PERCENT = 1.0
SECONDS = 32.5
"""Two periods of the motion, take and deliver a bottle."""


def whole_way(
    seed: int, seconds: float = SECONDS, suit: Sequence[str] = (), master: Sequence[str] = ()
) -> list[Figure]:
    """Table 1 and η for the suit of that seed; `suit` and `master` are overrides of the example files."""
    run = VirtualRun(World(overrides={"suit": [f"seed={seed}", *suit], "master": list(master)}))
    run.run(seconds)
    return judge(accuracy(run.trace.truth(), run.trace.solved(), run.trace.joint_names))


def judge(judged: Accuracy) -> list[Figure]:
    """A run's figures, one value a side where there are two: the paper measured one arm."""
    rows = {
        joint: [row for side in SIDES if (row := judged.fast.get(f"{side}_{joint}")) is not None]
        for joint in TABLE_1
    }
    names = {joint: joint.replace("_", " ") for joint in TABLE_1}
    errors = [
        Figure(
            f"{names[joint]}, mean error",
            "°",
            tuple(row.error_deg for row in rows[joint]),
            paper.error_deg,
            paper.error_deg,
        )
        for joint, paper in TABLE_1.items()
    ]
    shares = [
        Figure(f"{names[joint]}, share of the step", "", tuple(row.ratio for row in rows[joint]), paper.ratio)
        for joint, paper in TABLE_1.items()
    ]
    etas = tuple(eta for eta in judged.eta_percent_by_side.values() if eta is not None)
    return [
        *errors,
        *shares,
        Figure("η (Eq. 25)", "%", etas, ETA_PERCENT, ETA_TARGET_PERCENT),
        Figure("beside η: mean absolute error", "°", _known(judged.fast_mae_deg)),
        Figure("beside η: RMSE", "°", _known(judged.fast_rmse_deg)),
    ]


def _known(value: float | None) -> tuple[float, ...]:
    return () if value is None else (value,)
