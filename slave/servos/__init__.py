"""What moves the joints and reads them back: one Protocol, one folder a backend (slave/backends.py)."""

from slave.servos.servos import EncoderReading, LimitsTorque, Servos

__all__ = ["EncoderReading", "LimitsTorque", "Servos"]
