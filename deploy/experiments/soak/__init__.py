"""The whole way for hours, with faults: what it lost, how it came back, what grew."""
