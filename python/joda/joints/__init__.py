"""A joint by itself: its laws, its numbers, simulated in C++ or JAX."""
