"""What is shown: figures, pages, pictures and films of scenes."""
