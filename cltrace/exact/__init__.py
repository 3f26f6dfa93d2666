"""The exact engine: which of two hits is nearer, whether a point is lit, where a ray meets a surface.

Nothing is rounded but what it returns as a double.

surds.py   numbers p + q sqrt(s) with integers
lines.py   points, lines, where a line meets a surface, and the order of that; clipping planes
shapes.py  spheres and ellipsoids, triangles, cylinders
"""
