"""Which packages tandem can run without, and how to install each of them."""

from __future__ import annotations

EXTRAS = {
    "canopen": "simulation",
    "dynamixel_sdk": "dynamixel",
    "gpiod": "gpio",
    "cyclonedx_py": "audit",
    "pip_audit": "audit",
    "linuxpy": "v4l2",
    "evdev": "input",
    "sounddevice": "sound",
    "rosbags": "ros",
    "aiohttp": "console",
    "foxglove_schemas_protobuf": "viewer",
    "google": "viewer",
    "pyarrow": "export",
    "av": "export",
    "livekit": "voice",
    "prometheus_client": "metrics",
    "pylsl": "lsl",
    "vqf": "vqf",
}
"""The extra of pyproject.toml that brings each optional module."""


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to install, where the module that is missing is optional; None for any other module."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRAS:
        return None
    return f"the package {module} is not installed: pip install 'tandem[{EXTRAS[module]}]'"
