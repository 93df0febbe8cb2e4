"""What a terminal of 80 columns shows of a finished trial."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.report.findings import find
from deploy.experiments.trial.view import print_findings
from tests.deploy.experiments.trial.made_up import PLAN, cells


def test_setups_stand_whole_in_80_columns_under_their_network(tmp_path: Path) -> None:
    plan = replace(PLAN, transports=("tcp", "quic-datagram", "ws"), profiles=("lan", "intercontinental"),
                   strategies=("latest", "interpolate"))  # fmt: skip
    folder = Folder(tmp_path)
    folder.begin(plan)
    for one in cells(replace(plan, transports=("tcp", "quic-datagram"))):
        folder.keep(one)
    out = io.StringIO()
    print_findings(find(folder), Console(file=out, width=80))
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    assert max(map(len, lines)) <= 80
    assert lines.index(" intercontinental") > lines.index(" lan")
    assert sum("quic-datagram interpolate" in line and "1." in line for line in lines) >= 2
    assert "lan, ws with latest: not run yet" in lines
    assert any(line.split()[:3] == ["flow", "after", "outage"] and "passed" in line for line in lines)
    assert any(line.startswith("Holding a hand: ") for line in lines)


def test_cells_that_failed_are_told_with_the_targets(tmp_path: Path) -> None:
    folder, (first, *others) = Folder(tmp_path), cells()
    folder.begin(PLAN)
    for one in (Cell(first.key, CellStatus.FAILED, "the robot is not heard"), *others):
        folder.keep(one)
    out = io.StringIO()
    print_findings(find(folder), Console(file=out, width=120))
    assert "1 failed: ran without a result" in out.getvalue()
    [flow] = [line for line in out.getvalue().splitlines() if "flow after outage  " in line]
    assert "failed" in flow
    assert "1 failed" in flow
