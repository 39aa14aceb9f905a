"""Regular grids, and the shapes in them, lowered to stencils and node vectors."""
