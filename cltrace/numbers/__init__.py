"""Numbers that lose less than doubles do, or nothing at all; for all rooms, and of no scene.

vectors.py   dot and cross products of triples of any numbers
pairs.py     double-double arithmetic in numpy
fine.py      the same, where each number keeps count of its error
whole.py     doubles as whole numbers of any size, in numpy and in plain Python
surds.py     p + q sqrt(s), exactly
inverses.py  inverses of (3, 3) matrices, exactly or rounded once
"""
