"""Shortest paths and exact distance on polyhedral surfaces, and along straight lines in tets."""
