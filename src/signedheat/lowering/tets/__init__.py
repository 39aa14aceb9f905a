"""Tet meshes, and the shapes in them, lowered to Crouzeix–Raviart elements."""
