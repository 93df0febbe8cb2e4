"""Paper A: the nurse's arms, the whole way on the virtual clock, as `tandem demo` judges them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from common.config.sensor_calibration import Made
from common.quaternion import IDENTITY
from common.skeleton import load_skeleton
from deploy.experiments.accuracy.papers.figures import PaperValue
from deploy.experiments.accuracy.papers.units import SESSION, calibrate
from deploy.measure import Accuracy, accuracy
from deploy.measure.accuracy import SIDES, FastAccuracy
from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.tray import TrayConfig
from deploy.sim.world.world import VirtualWorld, WorldSettings
from master.calibrate.node_file import write_calibration

ETA_TARGET_PERCENT = 1.0
ARMS = ("chest", "left_upper_arm", "left_forearm", "right_upper_arm", "right_forearm")
"""The segments that Table 1's angles lie between."""
ZERO_POSE_S = 2.0
"""Within the first 3.5 s of the motion, while the operator stands in the zero pose."""
SECONDS = 32.5
"""Two periods of the motion, take and deliver a bottle."""


def whole_way(
    seed: int, seconds: float = SECONDS, suit: Sequence[str] = (), master: Sequence[str] = ()
) -> list[PaperValue]:
    """Table 1 and η for the suit of that seed; `suit` and `master` are overrides of the example files."""
    run = VirtualWorld(WorldSettings(overrides={"suit": [f"seed={seed}", *suit], "master": list(master)}))
    run.run(seconds)
    return judge(accuracy(run.trace.truth(), run.trace.solved(), run.trace.joint_names))


def as_a_suit(seed: int, seconds: float = SECONDS) -> list[PaperValue]:
    """The same with what only a suit knows: how its units sit, a zero pose first, what elbows cannot do.

    The alignment is as `tandem calibrate align` leaves it, here of units that sit straight.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "straight.toml"
        made = Made(date=date.today(), recording="none: straight by construction", unit="rad")
        write_calibration(file, {"alignment": (IDENTITY, made)})
        master = [f"estimation.zero_pose_s={ZERO_POSE_S}", 'estimation.constraints="online"']
        master += [f"nodes.{name}.calibration={json.dumps(str(file))}" for name in ARMS]
        return whole_way(seed, seconds, (), master)


def own_calibration(seed: int, seconds: float = SECONDS, session: TrayConfig = SESSION) -> list[PaperValue]:
    """The same with units as delivered, calibrated by a session of their own and put on in the zero pose."""
    names = load_skeleton("nursing").segment_names
    chosen = [names.index(name) for name in ARMS]
    units = Imperfections("raw", len(names), seed)
    affine = calibrate(units, len(names), chosen, seed, session).calibration.affine
    with tempfile.TemporaryDirectory() as folder:
        master = [f"estimation.zero_pose_s={ZERO_POSE_S}"]
        for name, unit in zip(ARMS, chosen, strict=True):
            path = Path(folder) / f"{name}.toml"
            parts = zip(("accelerometer", "gyroscope", "magnetometer"), affine[:, unit].tolist(), strict=True)
            path.write_text("".join(f"{part} = {rows}\n" for part, rows in parts), "utf-8")
            master.append(f"nodes.{name}.calibration={json.dumps(str(path))}")
        return whole_way(seed, seconds, ['grade="raw"'], master)


def judge(judged: Accuracy) -> list[PaperValue]:
    """A run's figures, one value a side where there are two: the paper measured one arm."""
    # one arm's figure must not stand for two where the other's is withheld
    rows = {joint: [] if judged.worse(joint) is None else _sides(judged, joint) for joint in TABLE_1}
    names = {joint: joint.replace("_", " ") for joint in TABLE_1}
    errors = [
        PaperValue(
            f"{names[joint]}, mean error",
            "°",
            tuple(row.error_deg for row in rows[joint]),
            paper.error_deg,
            paper.error_deg,
        )
        for joint, paper in TABLE_1.items()
    ]
    shares = [
        PaperValue(
            f"{names[joint]}, share of the step", "", tuple(row.ratio for row in rows[joint]), paper.ratio
        )
        for joint, paper in TABLE_1.items()
    ]
    by_side = judged.eta_percent_by_side.values()
    etas = () if judged.eta_percent is None else tuple(eta for eta in by_side if eta is not None)
    return [
        *errors,
        *shares,
        PaperValue("η (Eq. 25)", "%", etas, ETA_PERCENT, ETA_TARGET_PERCENT),
        PaperValue("beside η: mean absolute error", "°", _known(judged.fast_mae_deg)),
        PaperValue("beside η: RMSE", "°", _known(judged.fast_rmse_deg)),
    ]


def _sides(judged: Accuracy, joint: str) -> list[FastAccuracy]:
    return [row for side in SIDES if (row := judged.fast.get(f"{side}_{joint}")) is not None]


def _known(value: float | None) -> tuple[float, ...]:
    return () if value is None else (value,)
