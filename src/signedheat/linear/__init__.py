"""Sparse factorisations: one file per back end, one chooser."""
