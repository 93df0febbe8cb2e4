"""`python -m master FILE`."""

import sys

from common.process.launch import launch
from master.app import run
from master.config import MasterConfig

sys.exit(launch("master", MasterConfig, run))
