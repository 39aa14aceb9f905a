"""Shortest paths and exact distance on polyhedral surfaces, and any-angle distance in tet meshes."""
