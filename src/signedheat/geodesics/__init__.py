"""Distance along polyhedral surfaces: exact, and the shortest paths."""
