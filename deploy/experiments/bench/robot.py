"""What the simulated robot costs."""

from __future__ import annotations

from common.process.heap import freeze_heap
from common.skeleton import load_skeleton
from deploy.measure.timing import time_calls
from slave.model.build import STEP_S
from slave.servos.mujoco.simulated import CYCLE_NS, STEPS_PER_CYCLE, SimulatedRobot


def robot(seconds: float) -> dict[str, object]:
    """µs a MuJoCo step, taken over the drives' cycles, and percent of a core to keep up with real time."""
    simulated = SimulatedRobot(load_skeleton("nursing"))
    reach = simulated.position_rad + 0.3
    freeze_heap()

    def cycle() -> None:
        simulated.write(reach)
        simulated.advance(simulated.now_ns + CYCLE_NS)
        simulated.read()

    figures = time_calls(cycle, seconds)
    step_us = {key: value if key == "count" else value / STEPS_PER_CYCLE for key, value in figures.items()}
    return {"step_us": step_us, "step_s": STEP_S, "core_percent": 1e-4 * step_us["median"] / STEP_S}
