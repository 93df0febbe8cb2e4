"""`python -m slave FILE`."""

import sys

from common.process.launch import launch
from slave.app import run
from slave.config import SlaveConfig

sys.exit(launch("slave", SlaveConfig, run))
