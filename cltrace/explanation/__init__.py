"""Why a pixel has its colour: each number on the way, in the words and the order of the course's tutorial.

record.py    what there is to say, as frozen dataclasses
words.py     prints it
table.py     its numbers as a table
explanation.py  both together, which is what explain() returns
pixel.py     explain(), which fills the record: a pixel's ray, and those that mirrors and glass send on
meeting.py   what a ray meets, and what it passes by narrowly
lighting.py  what each light adds at a point, and what is in its way
shapes/      a file for each shape: the textbook's intersection test, in doubles, as a student's own code has it
triples.py   three numbers, and numbers as they are printed
names.py     surfaces and lights by kind, number and line of the file
space.py     from the reference tracer's camera space back to the world
many.py      many spheres as one surface, so that a pixel of a million of them takes seconds
"""
