"""What `python -m tests.wheels` asks pip for; pip itself is asked by hand, as it needs the network."""

import tomllib

from tests.wheels import ROOT, requirements


def test_the_core_of_a_robots_host_needs_no_package_without_wheels_for_aarch64() -> None:
    wanted = {each.split(">")[0].split("[")[0] for each in requirements("aarch64", "3.13")}
    assert {"numpy", "mujoco", "eclipse-zenoh", "uvloop", "canopen", "rosbags"} <= wanted
    assert wanted & {"vqf", "hdrhistogram", "evdev"} == set()
    assert "vqf>=2.1" in requirements("x86_64", "3.11")
    assert "vqf>=2.1" not in requirements("x86_64", "3.14"), "vqf ends at Python 3.13"


def test_what_is_built_on_the_host_is_an_extra() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["requires-python"] == ">=3.11,<3.15"
    assert project["optional-dependencies"]["vqf"] == ["vqf>=2.1"]
