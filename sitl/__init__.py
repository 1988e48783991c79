"""The simulated vehicle and its world."""
