"""Solids: broken shapes in space completed once, and measured anywhere."""
