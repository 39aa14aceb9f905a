"""The stencil of regular grids, matrix free: sweeps, multilevel diffusion, cosine transforms."""
