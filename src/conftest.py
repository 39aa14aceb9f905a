"""Doctests that need what `make test` does not install."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("torch") else ["signedheat/torch.py"]
