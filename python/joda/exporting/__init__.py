"""Scenes for who has no plugin: the nearest that other formats can express, and how near it is."""
