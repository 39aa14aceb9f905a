"""Sharpening: fields that are nearer to exact distance (Sec. 7.3), for every domain."""

from . import grids, surfaces, tets

__all__ = ["grids", "surfaces", "tets"]  # each registers how its fields are sharpened
