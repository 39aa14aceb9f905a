"""Shapes and cases with known distances, for the tests."""
