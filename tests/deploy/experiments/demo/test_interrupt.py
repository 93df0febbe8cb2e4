"""Ctrl-C in a terminal reaches the demo and its processes at once: one line, and nobody is left."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress

import pytest

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]

DEMO = """
import functools, sys
from deploy import cli
from deploy.harness import rig
from deploy.harness.child import Child
# processes that only wait, and end with an error by SIGINT: no suit, no robot
waiting = "import socket, sys; socket.create_connection(('127.0.0.1', int(sys.argv[1]))).recv(1)"
rig.Child = functools.partial(Child, tandem=(sys.executable, "-c", waiting, sys.argv[1]))
sys.argv[1:] = ["demo"]
cli.main()
"""


def test_ctrl_c_ends_the_demo_and_its_processes_with_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60)
        demo = subprocess.Popen(
            [sys.executable, "-c", DEMO, str(server.getsockname()[1])],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            call, _ = server.accept()
            with call:
                os.killpg(demo.pid, signal.SIGINT)
                out, err = demo.communicate(timeout=30)
            with pytest.raises(ProcessLookupError):
                os.killpg(demo.pid, 0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(demo.pid, signal.SIGKILL)
            demo.communicate()
    assert (demo.returncode, err) == (1, "tandem: interrupted: nothing was judged\n"), out
