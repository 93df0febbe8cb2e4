"""A USB-to-GPIO chip (CP2112) played through /dev/uhid: the kernel's own driver makes a gpiochip of it.

Its driver asks the chip for every level by a feature report, which takes as long as the chip likes: what a
real adapter behind USB does to whoever reads it. Report numbers and sizes are those of the maker's AN495.
"""

from __future__ import annotations

import os
import select
import struct
import threading
import time

UHID = "/dev/uhid"
LABEL = "cp2112_gpio"
_DESTROY, _GET, _GET_REPLY, _CREATE, _SET, _SET_REPLY = 1, 9, 10, 11, 13, 14
"""Events of the kernel's uhid.h."""
_CONFIG, _LEVELS, _VERSION, _SMBUS = 0x02, 0x03, 0x05, 0x06
_NO_SUCH_REPORT = 5
_USB, _VENDOR, _PRODUCT = 3, 0x10C4, 0xEA90
_DESCRIPTOR = bytes.fromhex("0600ff0901a101 8502 1500 26ff00 7508 9504 0901 b102 8503 9501 0901 b102 c0")
"""Two feature reports of vendor-defined bytes: the driver reads the rest without looking at it."""


class PlayedChip:
    """Eight lines, all high at first, until it is unplugged."""

    def __init__(self) -> None:
        self.levels = 0xFF
        self.answers_after_s = 0.0
        self._config = bytes([_CONFIG, 0, 0, 0, 0])
        self._file = os.open(UHID, os.O_RDWR)
        self._write(
            _CREATE, "128s64s64sHHIIII4096s", b"CP2112", b"", b"", len(_DESCRIPTOR), _USB, _VENDOR,
            _PRODUCT, 0, 0, _DESCRIPTOR,
        )  # fmt: skip
        self._ending = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Gone, in the middle of whatever is asked."""
        self._ending = True
        self._thread.join()
        self._write(_DESTROY, "")
        os.close(self._file)

    def _write(self, kind: int, form: str, *values: int | bytes) -> None:
        os.write(self._file, struct.pack(f"<I{form}", kind, *values))

    def _serve(self) -> None:
        while not self._ending:
            if not select.select([self._file], [], [], 0.05)[0]:
                continue
            event = os.read(self._file, 4380)
            kind, number, report = struct.unpack_from("<IIB", event)
            if kind == _SET:
                if report == _CONFIG:
                    self._config = event[12 : 12 + len(self._config)]
                self._write(_SET_REPLY, "IH", number, 0)
            elif kind == _GET:
                if self.answers_after_s:
                    time.sleep(self.answers_after_s)
                data = self._report(report)
                self._write(_GET_REPLY, "IHH4096s", number, 0 if data else _NO_SUCH_REPORT, len(data), data)

    def _report(self, number: int) -> bytes:
        return {
            _CONFIG: self._config,
            _LEVELS: bytes([_LEVELS, self.levels]),
            _VERSION: bytes([_VERSION, 0x0C, 2]),
            _SMBUS: bytes([_SMBUS]) + bytes(13),
        }.get(number, b"")
