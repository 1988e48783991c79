"""What touches hardware and time, and the records that every room shares."""
