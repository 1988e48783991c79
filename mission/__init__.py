"""What the flight does, and what may stop it."""
