"""Frames in, estimates out: where the power line runs in an image."""
