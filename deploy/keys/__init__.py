"""A private certificate authority, and a certificate for every host: `tandem keys`."""

AUTHORITY = "ca"
"""Its files' name: `ca.pem` and `ca.key`."""
