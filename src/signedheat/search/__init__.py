"""Queries at points: nearest faces and winding numbers."""
