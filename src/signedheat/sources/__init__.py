"""What distance is measured to: curves and points on surfaces, oriented area elements in space."""
