"""Many pictures: frames of a movie, as files or as one file.

frames says what each frame shows and how its file is called, fingerprint whether a file shows that already, writers
writes files, and animate draws.
"""
