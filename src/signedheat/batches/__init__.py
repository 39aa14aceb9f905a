"""Many shapes: jobs, workers on this machine or a cluster, and a manifest of what came of each shape."""
