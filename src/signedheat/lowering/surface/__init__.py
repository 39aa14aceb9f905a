"""Surfaces of every kind, and the curves and points on them, lowered to intrinsic meshes."""
