"""What stands beside the method: curves that bound nothing, morphology, figures of shapes."""
