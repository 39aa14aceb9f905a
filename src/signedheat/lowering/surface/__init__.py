"""Lowering of surfaces of every kind, and of curves and points on them, to intrinsic meshes."""
