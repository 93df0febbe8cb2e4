"""Whether the serial ports and the camera of a slave's file can be used. Pure."""

from __future__ import annotations

from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.needs import CameraNeed
from deploy.ops.doctor.read.devices import Device
from deploy.ops.doctor.read.servos import Pinged
from slave.servos.dynamixel.latency import BEST_MS, advice


def is_url(port: str) -> bool:
    """Whether the port is a URL of pyserial, such as socket://host:port: this host has no device for it."""
    return "://" in port


def judge_port(port: str, device: Device | None) -> Finding:
    """A serial port; `device` is None for a URL."""
    check = f"serial port {port}"
    if device is None:
        return ok(check, "a URL: opened at the start")
    if not device.there:
        return fail(check, "not there", "plug it in; lasting names are below /dev/serial/by-id")
    if not device.usable:
        return fail(check, "this user may not use it", "usermod -a -G dialout USER; the unit has that group")
    return ok(check, "there, and may be used")


def judge_latency(pinged: Pinged, reply_timeout_s: float) -> Finding:
    """How soon the servos on a serial port answer, and what its adapter's latency timer has to do with it."""
    port, timer, quickest_s = pinged.port, pinged.timer_ms, pinged.quickest_s
    check = f"latency of {port}"
    timed = "no latency timer known" if timer is None else f"latency timer {timer} ms"
    if quickest_s is None:
        words = f"{timed}; not measured: {pinged.why_not}"
        slow = timer is not None and 1e-3 * timer > reply_timeout_s
        return fail(check, words, advice(port, timer)) if slow else ok(check, words)
    words = f"{timed}; the quickest of {pinged.answers} answers took {1e3 * quickest_s:.1f} ms"
    if quickest_s > reply_timeout_s:
        words += f", and reply_timeout_s waits {1e3 * reply_timeout_s:g} ms: all would be called silent"
        return fail(check, words, advice(port, timer))
    if timer is not None and timer > BEST_MS:
        return warn(check, words, advice(port, timer))
    return ok(check, words)


def judge_camera(source: CameraNeed, device: Device, egl: bool, v4l2: bool, name: str = "") -> Finding:
    """A robot runs without its camera, so none of this is fatal. `name`: of one beside the main one."""
    check = f"camera {name}".rstrip()
    match source:
        case CameraNeed.OFF:
            return ok(check, "off")
        case CameraNeed.DRAWN if not egl:
            return warn(check, "no EGL to draw with", "apt install libegl1 libgl1-mesa-dri")
        case CameraNeed.DRAWN:
            return ok(check, "drawn by EGL")
    if not v4l2:
        return warn(check, "the package that reads it is missing", "pip install 'tandem[v4l2]'")
    if not device.there:
        return warn(check, f"no {device.path}", "plug it in; `ls /dev/video*`")
    if not device.usable:
        return warn(
            check, f"this user may not use {device.path}", "usermod -a -G video USER; the unit has that group"
        )
    return ok(check, f"{device.path} is there, and may be used")
