"""`python -m deploy.sim.network.janitor RUN`: removes a run's hosts when its parent has ended.

Its standard input is a pipe that only the parent holds: whatever ends the parent closes it.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from common.errors import NetworkError
from deploy.sim.network.namespaces import NetworkRun, parse_run, remove

REMOVE_S = 20.0


class Janitor:
    """The janitor process, from its parent's side."""

    def __init__(self, run: NetworkRun) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "deploy.sim.network.janitor", run.name],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is the parent's to answer
        )

    def remove(self) -> None:
        """Remove the hosts and wait for it. Raises NetworkError with what it could not remove."""
        try:
            _, errors = self._process.communicate(timeout=REMOVE_S)
        except subprocess.TimeoutExpired:
            raise NetworkError("the emulated hosts are not removed yet: see `ip netns list`") from None
        if self._process.returncode:
            raise NetworkError(f"the emulated hosts were not removed: {errors.strip()}")


def main() -> None:
    """Wait for the end of the parent, then remove what it made."""
    run = parse_run(sys.argv[1])
    if run is None:
        sys.exit(f"{Path(__file__).stem}: {sys.argv[1]}: expected the name of a run")
    sys.stdin.read()
    try:
        remove(run)
    except NetworkError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
