"""A flight on one self-contained page: everything in one file that opens without a network."""
