"""Tet meshes, and distance on them: operators, sources, discretisation, meshing, field."""
