"""Broken curves on surfaces and drawings in the plane: their orientation, their completion and the distance to them."""
