"""Shapes and sources whose distance is known, or that are awkward on purpose: for tests and benchmarks."""
