"""Profiles bent until the simulation moves as was measured."""
