"""Lowering: from domains and sources to the discretisations that the method runs on."""
