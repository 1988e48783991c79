"""What is truly in a rendered picture: which pixels, how far, which lines and boxes."""
