"""What is near or around a place: nearest faces, their features, winding numbers."""
