"""Lowering of regular grids, and of shapes in them, to stencils and node vectors."""
