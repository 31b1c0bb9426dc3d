"""What is done to a joint: hands, robots, pushes; and what it does by itself."""
