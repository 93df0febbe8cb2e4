"""Whether this host is ready for its role, and what must be done if not: `tandem doctor`."""
