"""Hostile scenes of meshes, mirrors and glass, and what the oracle says of their pictures: only tests use them."""
