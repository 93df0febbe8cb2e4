"""What a real-time process knows, handed to local readers without ever waiting for one.

Recorder, console and metrics are processes of their own behind a Unix socket. The sender does no more in the
control loop than one `send` a message; a reader that stands still is refused, and the refusals are counted.
"""
