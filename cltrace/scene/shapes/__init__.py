"""One module a shape: what a scene holds of it. shape.py says what a shape has, and table.py which there are."""
