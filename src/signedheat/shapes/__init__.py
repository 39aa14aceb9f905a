"""Shapes from anywhere: what is taken for one, conversion, motion, area elements, inspection."""
