"""Lowering of tet meshes, and of shapes in them, to Crouzeix–Raviart elements."""
