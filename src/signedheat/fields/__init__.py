"""Fields: values on any domain, what they are distances to, and their arithmetic."""
