"""Tets around and inside broken shapes."""
