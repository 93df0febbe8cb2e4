"""A stop must not wait for what only keys need."""

import subprocess
import sys


def test_the_command_line_starts_without_cryptography() -> None:
    program = "import sys, deploy.cli; print([m for m in sys.modules if m.startswith('cryptography')])"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
