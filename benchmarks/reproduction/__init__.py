"""The figures of the paper (Feng & Crane 2024), one function each, and the methods that it compares with."""
