"""Why a pixel has its colour: each number on the way, in the words and the order of the course's tutorial.

record.py       what there is to say, as frozen dataclasses
words.py        prints it
explanation.py  all of it, which is what explain() returns: as text, as JSON and as a table
pixel.py        explain(), which fills the record: a pixel's ray, and those that mirrors and glass send on
textbook.py     the textbook's intersection test of each shape, in doubles, as a student's own code has it
"""
