"""Arrays of pixels -> an Image, shown and stored."""
