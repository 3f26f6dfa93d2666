"""The shapes that rays may meet: what each is, as arrays in the world, and what of it doubles, pairs of these and whole
numbers decide. shape.py says what a shape has, and table.py which there are."""
