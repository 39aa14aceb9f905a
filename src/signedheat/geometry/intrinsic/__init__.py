"""Intrinsic triangulations: flips, refinement, and the transfer of points and curves to them."""
