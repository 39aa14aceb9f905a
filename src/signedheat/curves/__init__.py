"""Curves on surfaces as they are drawn: which side is which, what closes them, and the distance to them."""
