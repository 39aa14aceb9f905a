"""What distance is measured on, or to: one frozen dataclass per kind of geometry."""
