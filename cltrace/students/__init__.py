"""What is right or wrong with a picture: check, comparison, which lights reach what."""
