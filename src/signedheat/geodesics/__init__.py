"""Exact distance and shortest paths along polyhedral surfaces."""
