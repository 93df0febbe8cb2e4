"""What is so: facts from /sys, /proc, devices, keys and robots. Each reader takes where to look."""
