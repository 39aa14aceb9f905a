"""Run one job on many shapes, in processes of this machine or on a cluster, and record the outcomes in a manifest."""

from .job import Job, Sampling, Watertight
from .manifest import Outcome
from .pool import Batch, run

__all__ = ["Batch", "Job", "Outcome", "Sampling", "Watertight", "run"]
