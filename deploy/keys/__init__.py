"""A private certificate authority, and a certificate for every host: `tandem keys`."""
