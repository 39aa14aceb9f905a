"""Intrinsic triangulations: edge flips, refinement, and the transfer of points and curves to them."""
