"""What went wrong on a flight, and whose fault it was: perception, the executive, the autopilot, or the wind."""
