"""One path against two on the terminal, and as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from common.errors import TandemError
from deploy.experiments.trial.paths.study import PathRow, rows
from deploy.report.tables import UNKNOWN, number, plain_table
from deploy.sim.network.profile import load_profile

FILE = "paths.json"


def run_paths_trial(
    names: tuple[str, ...], seconds: float, seed: int, folder: Path, console: Console
) -> None:
    """Compare, print and write. Raises TandemError for anything but two networks."""
    if len(names) != 2:
        raise TandemError(
            f"--profiles {','.join(names)}: expected two networks, the first and the second path"
        )
    first, second = (load_profile(name) for name in names)
    table = plain_table(
        "first path", "paths", "holds", "followed %", "missing %", "RMSE °", "kB/s",
        title=f"{names[0]} alone, and with {names[1]} beside it",
    )  # fmt: skip
    done: list[PathRow] = []
    with console.status("following") as status:
        for row in rows(first, second, seconds, seed):
            done.append(row)
            status.update(f"{len(done)} runs done")
            table.add_row(
                row.fault, str(row.paths), str(row.holds), number(100.0 * row.followed, 0),
                number(100.0 * row.missing, 1),
                UNKNOWN if row.rmse_deg is None else number(row.rmse_deg, 2), number(row.kb_s, 1),
            )  # fmt: skip
    console.print(table)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / FILE).write_text(json.dumps([asdict(row) for row in done], indent=2) + "\n", "utf-8")
