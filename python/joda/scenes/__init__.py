"""MJCF scenes: read, written, and moved."""
