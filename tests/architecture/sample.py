"""The files that a reader opens to follow one sample from the CAN frame to the encoder, in order.

These are the stages that take the sample, change it, refuse it or send it on. The list leaves out the pure
mathematics that a stage calls (quaternions, affine maps, the nearest rotation, the Kalman step) and the
observers (plausibility checks, latency stamps, watchdogs).
"""

SAMPLE_PATH = [
    "common/can/bus.py",
    "master/app.py",
    "master/pipeline.py",
    "master/suit/poll.py",
    "master/suit/intake.py",
    "master/orientation/estimator.py",
    "master/orientation/lowpass.py",
    "master/orientation/vqf.py",
    "master/joint_angles/solver.py",
    "common/reach/follower.py",
    "master/robot.py",
    "common/wire/codec.py",
    "common/link/link.py",
    "slave/app.py",
    "slave/pipeline.py",
    "slave/guard/guard.py",
    "slave/guard/admit.py",
    "slave/track/predict.py",
    "slave/limit/limit.py",
    "slave/servos/mujoco/servos.py",
]
