"""Fields: the results, values of φ with the domain that they belong to."""
