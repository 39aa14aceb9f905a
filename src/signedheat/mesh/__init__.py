"""Triangles and tets as plain arrays: edges, welding, components, cutting; intrinsic meshes; no domains."""
