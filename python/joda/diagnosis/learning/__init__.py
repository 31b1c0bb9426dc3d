"""A law that no catalogue has, learned from what a model misses, and told in words."""
