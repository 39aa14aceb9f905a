"""Domains and sources, that is, what distance is measured on and what to: one frozen dataclass per kind of geometry."""
