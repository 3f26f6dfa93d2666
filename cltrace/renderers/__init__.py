"""The front door: a scene goes through plan and run, and comes out as an Image."""
