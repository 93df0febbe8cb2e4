"""What moves the joints and reads them back: one Protocol, one adapter a robot."""

from slave.servos.servos import EncoderReading, Servos

__all__ = ["EncoderReading", "Servos"]
