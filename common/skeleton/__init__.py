"""Segments, joints and limits as data: one TOML table a robot, read once."""

from common.skeleton.load import load_skeleton
from common.skeleton.table import WORLD, Joint, Post, RobotHinge, RobotLink, Segment, Shape, Skeleton, Synergy

__all__ = [
    "WORLD",
    "Joint",
    "Post",
    "RobotHinge",
    "RobotLink",
    "Segment",
    "Shape",
    "Skeleton",
    "Synergy",
    "load_skeleton",
]
