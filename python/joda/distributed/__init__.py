"""Joints as tasks: what one needs and leaves, and who runs many of them."""
