"""The main job on one machine: suit, master and slave as separate processes, watched and judged."""
