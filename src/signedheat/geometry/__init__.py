"""Arrays in, arrays out: edges, intrinsic meshes, surface points, closest points, level sets. No domain, no solver."""
