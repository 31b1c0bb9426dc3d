"""What a model lacks: found, said, added."""
