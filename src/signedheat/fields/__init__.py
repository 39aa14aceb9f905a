"""Results: values that know their domain."""
