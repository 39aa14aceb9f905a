"""What goes beyond the three steps; uses the core through its public face."""
