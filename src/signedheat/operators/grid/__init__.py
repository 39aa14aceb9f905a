"""Matrix-free operators on regular grids: sweeps, multilevel diffusion, cosine transforms, closest points."""
