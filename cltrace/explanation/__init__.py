"""Why a pixel has its colour: each number on the way, in the words and the order of the course's tutorial.

record.py   what there is to say, as frozen dataclasses
formulas.py the textbook's intersection tests, in doubles, as a student's own code has them
pixel.py    fills the record for a pixel of a scene, by way of the reference tracer
words.py    prints it
"""
