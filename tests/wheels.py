"""`python -m tests.wheels`: whether a host without a compiler can install tandem, by architecture and Python.

For each Python it lets pip resolve all dependencies of pyproject.toml from wheels alone, as that host would.
What has none is named, with the requirement that wants it. Needs the network; downloads nothing but metadata.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
GLIBC = (28, 27, 26, 24, 17)
"""manylinux_2_N: Debian 12, Ubuntu 22.04 and the Jetson's have at least 2.35."""
EXTRAS = (
    "simulation", "dynamixel", "gpio", "ros", "sound", "v4l2", "h264", "console", "metrics", "viewer",
    "export", "lsl", "voice",
)  # fmt: skip
"""What is installed beside the core. `input` and `vqf` are built on the host, and the page says so."""


def requirements(machine: str, python: str, extras: Sequence[str] = EXTRAS) -> list[str]:
    """What a Linux host of that machine and Python installs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    wanted = [*project["dependencies"]]
    for extra in extras:
        wanted += project["optional-dependencies"][extra]
    host = {
        "platform_machine": machine, "sys_platform": "linux", "platform_system": "Linux", "os_name": "posix",
        "python_version": python, "python_full_version": f"{python}.0", "implementation_name": "cpython",
    }  # fmt: skip
    parsed = [Requirement(each) for each in wanted]
    return [f"{r.name}{'[' + ','.join(r.extras) + ']' if r.extras else ''}{r.specifier}" for r in parsed
            if r.marker is None or r.marker.evaluate(host)]  # fmt: skip


def resolve(machine: str, python: str, wanted: Sequence[str]) -> str:
    """Empty where all of them install from wheels, else what pip says."""
    platforms = [f"manylinux_2_{n}_{machine}" for n in GLIBC] + [f"manylinux2014_{machine}"]
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [
                sys.executable, "-m", "pip", "install", "--dry-run", "--quiet", "--only-binary=:all:",
                *(word for platform in platforms for word in ("--platform", platform)),
                "--python-version", python, "--implementation", "cp", "--target", folder, *wanted,
            ],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
    return "" if done.returncode == 0 else "; ".join(errors) or done.stderr


def missing(machine: str, python: str) -> dict[str, str]:
    """What has no wheels there, by requirement."""
    wanted = requirements(machine, python)
    if not resolve(machine, python, wanted):
        return {}
    return {one: why for one in wanted if (why := resolve(machine, python, [one]))}


def main() -> int:
    """A line for each machine and Python; status 1 where something is missing."""
    options = argparse.ArgumentParser(prog="python -m tests.wheels", description=__doc__)
    options.add_argument("--machine", action="append", help="such as aarch64 (the default) or x86_64")
    options.add_argument("--python", action="append", help="such as 3.12; by default 3.11 to 3.14")
    chosen = options.parse_args()
    failed = False
    for machine in chosen.machine or ["aarch64"]:
        for python in chosen.python or PYTHONS:
            lacking = missing(machine, python)
            failed |= bool(lacking)
            words = "; ".join(f"{one}: {why}" for one, why in lacking.items()) or "all have wheels"
            print(f"{machine} Python {python}: {words}", flush=True)  # noqa: T201
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
