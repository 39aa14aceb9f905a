"""Extensions beyond the three steps: sharpening, piecewise distance, completion of curves, morphology, tet meshing."""
