"""A trial with the robot asked for over the link: `tandem trial serve` in a process of its own."""

from __future__ import annotations

import asyncio
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deploy.experiments.trial.cell.plan import CellKey, Setup, TrialPlan
from deploy.experiments.trial.cell.result import CellStatus
from deploy.experiments.trial.remote.operator import run_remote_cell
from deploy.harness.endpoints import free_port
from deploy.harness.host import HostWatch

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400), pytest.mark.usefixtures("default_signals")]


def test_a_cell_over_a_real_network_is_judged_by_the_measured_offset(
    tmp_path: Path, on_this_host: OnThisHost
) -> None:
    setup = Setup("udp", "loopback", "predict")
    endpoint = f"tcp/127.0.0.1:{free_port('tcp')}"
    plan = TrialPlan(
        transports=("udp",), profiles=("loopback",), strategies=("predict",), repeat=1, seconds=5.0,
        outage_s=0.0, robot="nursing", motion="sweep", seed=1, router=False, max_age_s=0.3, hosts=endpoint,
    )  # fmt: skip

    async def story(_: HostWatch) -> None:
        with (tmp_path / "serve.log").open("wb") as log:
            server = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "deploy", "trial", "serve", "--listen", endpoint,
                "--address", "127.0.0.1", "--port", str(free_port("udp")), stderr=log,
            )  # fmt: skip
        try:
            words: list[str] = []
            cell = await run_remote_cell(plan, CellKey(setup, 1), asyncio.Event(), words.append)
            assert cell.status is CellStatus.DONE, cell.why
            values = cell.values
            assert values["true_one_way_p50_ms"] is None, "two hosts have no shared clock"
            one_way, bound = values["one_way_p50_ms"], values["one_way_bound_ms"]
            assert one_way is not None
            assert bound is not None
            assert 0.0 <= one_way < 100.0
            assert 0.0 < bound < 100.0
            assert values["accepted"] is not None
            assert values["accepted"] > 50.0
            assert values["rmse_deg"] is not None
            assert values["cpu_slave"] is not None
            assert values["cpu_slave"] > 0.0
            assert values["flow_s"] is None
            assert "fetching the robot's messages" in words
            server.send_signal(signal.SIGTERM)
            assert await asyncio.wait_for(server.wait(), 30) == 0, (tmp_path / "serve.log").read_text("utf-8")
        finally:
            with suppress(ProcessLookupError):
                server.kill()
            await server.wait()

    on_this_host(story)
