"""One module a shape: its intersection test by the textbook, in numbers and in words. table.py has them all."""
