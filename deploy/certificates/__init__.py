"""A private certificate authority, and a certificate for every host: `tandem keys`."""

from common.errors import TandemError

AUTHORITY = "ca"
"""Its files' name: `ca.pem` and `ca.key`."""


class KeysError(TandemError):
    """Keys that cannot be made, written or read."""
