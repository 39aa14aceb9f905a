"""Many shapes: one job for each, in processes of this machine or a cluster, and a manifest of what came of them."""

from .job import Job, Sampling, Watertight
from .manifest import Outcome
from .pool import Batch, run

__all__ = ["Batch", "Job", "Outcome", "Sampling", "Watertight", "run"]
