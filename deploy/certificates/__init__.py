"""A private certificate authority, and a certificate for every host: `tandem keys`."""

from common.errors import TandemError

AUTHORITY = "ca"
"""Its files' name: `ca.pem` and `ca.key`."""
REVOKED = "revoked.txt"
"""The list of revoked names, in the folder of the authority; hosts keep a copy of it."""


class KeysError(TandemError):
    """Keys that cannot be made, written or read."""
