"""Tasks that `benchmarks/features.py` gives to this library and to others."""
