"""Surfaces, curves on them, and distance along them: domains, operators, sources, discretisation, field."""
