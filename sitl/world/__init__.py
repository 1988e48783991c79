"""The world a simulated flight happens in: read from a file, handed on as frozen records."""
