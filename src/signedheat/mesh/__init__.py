"""Triangles and tets as plain arrays, and intrinsic meshes: edges, welding, components, intersections, cutting."""
