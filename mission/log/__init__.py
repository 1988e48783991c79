"""The flight log: written as the flight goes, read afterwards."""
