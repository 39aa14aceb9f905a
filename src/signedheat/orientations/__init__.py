"""Evidence about sides, from neighbours, rays, windings and empty balls: which way faces and normals look."""
