"""Fits a joint's unknown numbers to segments of measured runs."""
