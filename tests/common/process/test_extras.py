"""A package that is optional and missing is named together with the command that installs it."""

from __future__ import annotations

import builtins
import os
import sys
import tomllib
from pathlib import Path

import pytest

from common.errors import RobotError
from common.process.extras import EXTRAS, missing_extra
from deploy import cli
from slave.servos.dynamixel.bus import Bus
from slave.servos.dynamixel.port import Port

PACKAGES = {"cyclonedx_py": "cyclonedx_bom", "google": "protobuf"}
"""Packages whose module has another name."""
PROJECT = tomllib.loads((Path(cli.__file__).parents[1] / "pyproject.toml").read_text("utf-8"))["project"]


def without(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a module, and all of tandem that was imported with it, had never been imported or installed."""
    real = builtins.__import__

    def import_(name: str, *rest: object, **named: object) -> object:
        if name.partition(".")[0] == module:
            raise ModuleNotFoundError(f"No module named {module!r}", name=module)
        return real(name, *rest, **named)  # type: ignore[arg-type]

    for loaded in list(sys.modules):
        if loaded.partition(".")[0] == module or loaded.startswith(("slave.servos.", "deploy.sim.drives.")):
            package, _, name = loaded.rpartition(".")
            if package in sys.modules and hasattr(sys.modules[package], name):
                # imported again it takes its package's attribute too, which must not outlive this test
                monkeypatch.setattr(sys.modules[package], name, sys.modules[loaded])
            monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setattr(builtins, "__import__", import_)


@pytest.mark.parametrize(("module", "extra"), EXTRAS.items())
def test_each_extra_is_one_of_the_project(module: str, extra: str) -> None:
    packages = [
        package.partition(">")[0].replace("-", "_") for package in PROJECT["optional-dependencies"][extra]
    ]
    assert PACKAGES.get(module, module) in packages
    assert f"tandem[{extra}]" in (missing_extra(ModuleNotFoundError(name=f"{module}.part")) or "")


def test_any_other_missing_module_is_a_fault() -> None:
    assert missing_extra(ModuleNotFoundError(name="common.no_such_file")) is None


def test_servos_without_their_package_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    without("dynamixel_sdk", monkeypatch)
    _, terminal = os.openpty()
    with pytest.raises(RobotError, match=r"pip install 'tandem\[dynamixel\]'"):
        Bus(Port(os.ttyname(terminal), 1_000_000, reply_timeout_s=0.01))


def test_a_command_without_its_package_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without("canopen", monkeypatch)
    monkeypatch.setattr(sys, "argv", ["tandem", "drives", "deploy/examples/slave.toml"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 1
    assert "pip install 'tandem[simulation]'" in capsys.readouterr().err
