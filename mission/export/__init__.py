"""A flight log for other programs: tables, maps, and images for reconstruction."""
