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

# live: beside other work an emulated processor would be too slow for the runner's own limit
pytestmark = [pytest.mark.live, pytest.mark.timeout(LIMIT_S + 30)]


CAN = "tests/contract/test_suit_bus.py"
NETEM = "tests/net/test_netem.py"
PEDALS = "tests/common/inputs/test_uinput.py"
BUTTONS = "tests/slave/stop_inputs/test_gpio_kernel.py"
SELECTED = "socketcan or netem or uinput or gpio_kernel"
"""Of the CAN contract only what needs this kernel; of the other files all, by their own names."""
ALL_ENDED = (0, 1)
"""pytest's status where every test has run: none, or some, failed."""


@pytest.fixture(scope="module")
def said() -> str:
    """What pytest prints on the other kernel, of all files: to start that kernel takes most of the time."""
    runner = os.environ.get("TANDEM_KERNEL_RUNNER")
    if not runner:
        pytest.skip("TANDEM_KERNEL_RUNNER is not set: the command that runs a command on another kernel")
    python = [sys.executable, "-m", "pytest", "-v", "-rA", "--color=no", "-p", "no:cacheprovider"]
    files = [CAN, NETEM, PEDALS, BUTTONS]
    done = subprocess.run(
        [*shlex.split(runner), *python, f"--timeout={LIMIT_S // 2}", "-k", SELECTED, *files],
        capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode in ALL_ENDED, done.stdout[-5000:] + done.stderr[-2000:]
    return done.stdout


def passed(said: str, file: str) -> set[str]:
    """Names of the tests of a file that passed; none of it may have failed.

    By pytest's list at its end: beside a running test the kernel's drivers write to the same console.
    """
    outcomes = re.findall(rf"^(\w+) {re.escape(file)}::(\S+)", said, re.MULTILINE)
    assert {outcome for outcome, _ in outcomes} <= {"PASSED"}, said[-5000:]
    return {name for _, name in outcomes}


def skipped(said: str, file: str) -> int:
    """How many tests of a file skipped."""
    return sum(map(int, re.findall(rf"^SKIPPED \[(\d+)\] {re.escape(file)}:", said, re.MULTILINE)))


def ends(said: str, outcome: str) -> set[tuple[str, str]]:
    """Test and wire of each that ended so. A test with variants counts once a variant."""
    found = re.findall(rf"::(\w+)\[(socketcan[\w-]+?)(-True|-False)?\] {outcome}", said)
    return {(test + variant, wire) for test, wire, variant in found}


def kernel_has_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def test_the_contract_holds_on_a_kernel_with_socketcan(said: str) -> None:
    if kernel_has_can():
        pytest.skip("this kernel has SocketCAN: the suite itself has run on it")
    assert passed(said, CAN)
    done, left_out = ends(said, "PASSED"), ends(said, "SKIPPED")
    wires = {wire for _, wire in done}
    assert wires == {"socketcan-vcan-fd", "socketcan-vcan-classic", CLASSIC}
    assert left_out == {NO_ERROR_FRAME}, said[-5000:]
    tests = {test for test, _ in done}
    assert len(done | left_out) == len(tests) * len(wires)


def test_the_profiles_hold_on_a_kernel_with_netem(said: str) -> None:
    assert passed(said, NETEM)
    assert skipped(said, NETEM) == 0


def test_pedals_work_on_a_kernel_with_uinput(said: str) -> None:
    if os.access("/dev/uinput", os.W_OK):
        pytest.skip("this kernel has uinput: its tests have run on it")
    if "this kernel has no uinput" in said:
        pytest.skip("the kernel of TANDEM_KERNEL_RUNNER has no uinput either")
    assert len(passed(said, PEDALS)) == 4, said[-5000:]
    assert skipped(said, PEDALS) == 0


def test_stop_buttons_work_at_a_gpiochip_of_the_kernel(said: str) -> None:
    if "this kernel has no uhid" in said:
        pytest.skip("the kernel of TANDEM_KERNEL_RUNNER has no uhid either")
    assert len(passed(said, BUTTONS)) == 4, said[-5000:]
    assert skipped(said, BUTTONS) == 0
