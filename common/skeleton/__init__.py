"""Segments, joints and limits as data: one TOML table a robot, read once."""

from common.skeleton.load import load_skeleton
from common.skeleton.table import WORLD, Joint, Segment, Skeleton

__all__ = ["WORLD", "Joint", "Segment", "Skeleton", "load_skeleton"]
