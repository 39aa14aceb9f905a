"""Discrete differential operators: sparse matrices and matrix-free kernels from plain arrays; no domains."""
