"""Pictures of fields and shapes, without a screen."""
