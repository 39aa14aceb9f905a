"""Geometry of plain arrays: edges, intrinsic meshes, surface points, closest points, level sets; no domains."""
