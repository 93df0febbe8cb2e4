"""The web console: a process of its own behind the tap. It shows robots in browsers.

Nothing of it runs in a control loop: a browser that is slow, stalled or hostile costs this process alone.
"""
