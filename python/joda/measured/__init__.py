"""Measured runs and curves: read, checked, and compared with a model."""
