"""What a camera sees of the world."""
