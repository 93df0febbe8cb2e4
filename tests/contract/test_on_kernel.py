"""What this kernel lacks (SocketCAN, netem, uinput) is tested by TANDEM_KERNEL_RUNNER on one that has it."""

from __future__ import annotations

import os
import re
import shlex
import socket
import subprocess
import sys

import pytest

LIMIT_S = 600
CLASSIC = "socketcan-kvaser-classic"
NO_ERROR_FRAME = ("test_an_error_frame_is_counted_and_not_handed_on", CLASSIC)
"""No error frame crosses a wire."""

pytestmark = pytest.mark.timeout(LIMIT_S + 30)


def on_kernel(*arguments: str) -> str:
    """What pytest prints on the other kernel; it has to end well there."""
    runner = os.environ.get("TANDEM_KERNEL_RUNNER")
    if not runner:
        pytest.skip("TANDEM_KERNEL_RUNNER is not set: the command that runs a command on another kernel")
    command = [
        *shlex.split(runner),
        sys.executable,
        "-m",
        "pytest",
        "-v",
        "--color=no",
        "-p",
        "no:cacheprovider",
    ]
    done = subprocess.run(
        [*command, f"--timeout={LIMIT_S // 2}", *arguments],
        capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    return done.stdout


def ends(said: str, outcome: str) -> set[tuple[str, str]]:
    """Test and wire of each that ended so."""
    return set(re.findall(rf"::(\w+)\[(socketcan[\w-]+)\] {outcome}", said))


def kernel_has_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def test_the_contract_holds_on_a_kernel_with_socketcan() -> None:
    if kernel_has_can():
        pytest.skip("this kernel has SocketCAN: the suite itself has run on it")
    said = on_kernel("tests/contract/test_suit_bus.py", "-k", "socketcan")
    passed, skipped = ends(said, "PASSED"), ends(said, "SKIPPED")
    wires = {wire for _, wire in passed}
    assert wires == {"socketcan-vcan-fd", "socketcan-vcan-classic", CLASSIC}
    assert skipped == {NO_ERROR_FRAME}, said[-5000:]
    tests = {test for test, _ in passed}
    assert len(passed | skipped) == len(tests) * len(wires)


def test_the_profiles_hold_on_a_kernel_with_netem() -> None:
    said = on_kernel("tests/net/test_netem.py")
    assert re.search(r"::test_\S+ PASSED", said)
    assert "SKIPPED" not in said


def test_pedals_work_on_a_kernel_with_uinput() -> None:
    if os.access("/dev/uinput", os.W_OK):
        pytest.skip("this kernel has uinput: its tests have run on it")
    said = on_kernel("tests/common/inputs/test_uinput.py")
    if "this kernel has no uinput" in said:
        pytest.skip("the kernel of TANDEM_KERNEL_RUNNER has no uinput either")
    assert len(re.findall(r"::test_\S+ PASSED", said)) == 4, said[-5000:]
    assert "SKIPPED" not in said


def test_stop_buttons_work_at_a_gpiochip_of_the_kernel() -> None:
    said = on_kernel("tests/slave/stop_inputs/test_gpio_kernel.py")
    if "this kernel has no uhid" in said:
        pytest.skip("the kernel of TANDEM_KERNEL_RUNNER has no uhid either")
    # the driver's own words, on the same console, stand between a test's name and its end
    assert re.search(r"= 4 passed in ", said), said[-5000:]
    assert "SKIPPED" not in said
