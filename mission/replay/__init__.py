"""A flight flown again by today's program, on the frames and states that its log kept."""
