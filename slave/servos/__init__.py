"""What moves the joints and reads them back: one Protocol, one adapter a robot."""

from slave.servos.open import open_servos
from slave.servos.servos import EncoderReading, Servos

__all__ = ["EncoderReading", "Servos", "open_servos"]
