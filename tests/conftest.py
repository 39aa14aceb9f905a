"""Settings that all tests share."""

from __future__ import annotations

import os
import signal

from hypothesis import HealthCheck, settings

settings.register_profile(
    "suite",
    max_examples=20,
    deadline=None,
    derandomize=True,  # the same cases every time; `HYPOTHESIS_PROFILE=search` looks for new ones
    suppress_health_check=list(HealthCheck),
)
settings.register_profile("search", max_examples=500, deadline=None, suppress_health_check=list(HealthCheck))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as shells leave it to what they start in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
