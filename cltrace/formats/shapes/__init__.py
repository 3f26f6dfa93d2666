"""One module a shape: how its element becomes what a Scene takes. table.py has them all."""
