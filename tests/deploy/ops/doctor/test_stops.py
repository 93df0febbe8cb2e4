"""The doctor on a robot's emergency stop inputs."""

from __future__ import annotations

import pytest

from deploy.examples.profiles import NURSING, example
from deploy.ops.doctor.judge.finding import Health
from deploy.ops.doctor.judge.needs import needs_of
from deploy.ops.doctor.judge.stops import judge_stops
from deploy.ops.doctor.read.stops import StopRead, read_stops
from slave.stop_inputs import robot_stops
from slave.stop_inputs.config import EstopConfig, StopInputConfig

LINE = StopInputConfig(name="red button", source="gpio", line="A line that no chip has")
STO = StopInputConfig(name="relay", source="sto", joint="neck_yaw")


@pytest.mark.parametrize(
    ("read", "health", "said"),
    [
        (StopRead(LINE, True), Health.OK, "closed, not pressed"),
        (StopRead(LINE, False), Health.FAIL, "pressed, or its wire is broken"),
        (StopRead(LINE, None, "No such device"), Health.FAIL, "No such device"),
        (StopRead(LINE, None, "line 2 of x is used by tandem e-stop"), Health.OK, "by the slave that runs"),
        (StopRead(LINE, None, "line 2 of x is used by gpiomon"), Health.FAIL, "used by gpiomon"),
        (StopRead(LINE.model_copy(update={"normally_closed": False}), True), Health.WARN, "normally open"),
        (StopRead(STO), Health.OK, "told to the slave by the drive"),
    ],
)
def test_each_input_is_judged_and_it_is_said_how_to_try_it(read: StopRead, health: Health, said: str) -> None:
    (finding,) = judge_stops([read], real_robot=True, reset_key=True)
    assert (finding.health, finding.check) == (health, f"stop input {read.config.name}")
    assert said in finding.found
    assert finding.advice


def test_a_real_robot_without_a_button_and_a_button_without_a_key_are_told() -> None:
    (none,) = judge_stops([], real_robot=True, reset_key=False)
    assert none.health is Health.WARN
    assert judge_stops([], real_robot=False, reset_key=False) == []
    *_, key = judge_stops([StopRead(LINE, True)], real_robot=True, reset_key=False)
    assert "reset_key" in key.found


def test_this_host_s_lines_are_read_and_those_of_drives_are_not() -> None:
    line, sto = read_stops(EstopConfig(inputs=[LINE, STO]))
    assert line.at_rest is None
    assert line.why
    assert (sto.at_rest, sto.why) == (None, "")


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> None:
        raise ModuleNotFoundError("No module named 'gpiod'", name="gpiod")

    monkeypatch.setattr("deploy.ops.doctor.read.stops.source_of", missing)
    (read,) = read_stops(EstopConfig(inputs=[LINE]))
    assert read.why == "the package gpiod is not installed: pip install 'tandem[gpio]'"
    assert robot_stops.source_of is not missing


def test_a_slave_s_file_names_its_inputs() -> None:
    needs = needs_of(example("slave", NURSING), ['guard.reset_key="x"'])
    assert needs.estop == EstopConfig()
    assert (needs.simulated, needs.reset_key) == (True, True)
