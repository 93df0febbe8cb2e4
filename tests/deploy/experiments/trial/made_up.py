"""A made-up trial: figures that differ as those of real setups do, and the same each time."""

from __future__ import annotations

import math
import random

from deploy.experiments.trial.cell.plan import CellKey, Setup, TrialPlan
from deploy.experiments.trial.cell.result import Cell, CellStatus, Excerpt

PLAN = TrialPlan(
    transports=("tcp", "udp"),
    profiles=("lan", "4g"),
    strategies=("latest", "predict"),
    repeat=3,
    seconds=20.0,
    outage_s=2.0,
    robot="nursing",
    motion="bottle",
    seed=1,
    router=False,
    max_age_s=0.0,
)
DELAY_MS = {"lan": 1.0, "wifi": 6.0, "4g": 45.0, "intercontinental": 150.0}
ERROR = {"latest": (2.0, 0.09, 4.5), "interpolate": (3.0, 0.1, 1.1), "predict": (0.9, 0.03, 2.0)}


def values(setup: Setup, seed: int) -> dict[str, float | None]:
    draw = random.Random(f"{setup} {seed}")

    def near(value: float) -> float:
        return value * draw.uniform(0.95, 1.05)

    delay = DELAY_MS[setup.profile] * (1.3 if setup.transport == "tcp" else 1.0)
    base, slope, rough = ERROR[setup.strategy]
    error = base + slope * delay
    return {
        "one_way_p50_ms": near(delay),
        "one_way_p99_ms": near(2.5 * delay),
        "one_way_corrected_p99_ms": near(3.0 * delay),
        "one_way_bound_ms": delay,
        "true_one_way_p50_ms": near(delay),
        "true_one_way_p99_ms": near(2.5 * delay),
        "round_trip_p50_ms": near(2.0 * delay),
        "round_trip_p99_ms": near(4.0 * delay),
        "age_p50_ms": near(delay + 9.0),
        "age_p99_ms": near(2.5 * delay + 15.0),
        "delivered": 100.0 if setup.transport == "tcp" else near(95.0),
        "accepted": 98.0,
        "rmse_deg": near(error),
        "rmse_over_latest": near(error / (2.0 + 0.09 * delay)),
        "lag_ms": near(delay + 40.0),
        "aligned_rmse_deg": near(0.9),
        "roughness": near(rough + 0.004 * delay),
        "eta_percent": near(3.0),
        "tracked": 100.0,
        "holds": 0.0,
        "refused": 2.0,
        "clamps": 1.0,
        "flow_s": near(0.6),
        "stale_accepted": 0.0,
        "stale_refused": 1.0,
        "moved_alone": 0.0,
        "ready_s": near(0.8),
        "track_again_s": near(1.5),
        "cpu_master": near(24.0),
        "cpu_slave": near(31.0),
        "up_kb_s": near(9.0),
        "down_kb_s": near(41.0),
        "ticks_missed": 0.1,
    }


def cell(key: CellKey) -> Cell:
    at_s = [0.04 * i for i in range(150)]
    late_s = 0.001 * (DELAY_MS[key.setup.profile] + 40.0)
    return Cell(
        key=key,
        status=CellStatus.DONE,
        values=values(key.setup, key.repetition),
        remarks=("held after 7.2 s: no command for 0.2 s; engaged again",) if key.repetition == 2 else (),
        settings={"guard.max_age_s": "0.45"},
        counts={"dropped": {"age": 2}, "clamps": {"velocity": 1}},
        one_way_ms=tuple(DELAY_MS[key.setup.profile] * (1 + 0.015 * p) for p in range(101)),
        excerpt=Excerpt(
            "right_shoulder_pitch",
            at_s,
            [30 * math.sin(1.3 * t) for t in at_s],
            [30 * math.sin(1.3 * (t - late_s)) for t in at_s],
        ),
    )


def cells(plan: TrialPlan = PLAN) -> list[Cell]:
    return [cell(key) for key in plan.cells()]
