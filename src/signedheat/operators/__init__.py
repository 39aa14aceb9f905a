"""Discrete operators: arrays in, sparse matrices or kernels out. No domain, no solver."""
