"""The simulated vehicle and its world beside the mission: the only package that imports sitl."""
