"""The camera's own process: `python -m slave.camera`, which only the slave starts.

It has a process of its own because drawing holds up whatever shares an interpreter with it, and a graphics
driver may crash. It ends with the slave: when its standard input does.
"""

from __future__ import annotations

import os
import signal
import sys

# first of all: the slave's real-time priority is not for what is imported and drawn here
os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
os.nice(19)
# Ctrl-C and a closed terminal are for the slave, which ends this one
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGHUP, signal.SIG_IGN)

from slave.camera.child import main  # noqa: E402

main(sys.argv[1])
