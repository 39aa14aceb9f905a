"""A fuzzer: cases by seed, each in a worker with a watchdog. `fuzz.frame` tells how families of cases are written."""
