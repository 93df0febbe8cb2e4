"""A Zenoh router that lets nobody do what he may not: `tandem router`."""
