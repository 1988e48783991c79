"""Flights held against each other."""
