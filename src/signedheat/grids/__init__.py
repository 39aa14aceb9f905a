"""Regular grids, and distance on them: diffusion, Poisson equations, contours, redistancing, field."""
