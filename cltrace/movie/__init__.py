"""Many pictures: frames of a movie, as files or as one file.

frames says what each frame shows and how its file is called, writers writes files, and says whether one shows a frame
already, and animate draws.
"""
