"""Many pictures: frames of a movie, as files or as one file. It stands above the front door.

frames says what each frame shows, names where it goes, fingerprint whether a file is what it would be; pipeline hands
frames out, draws them and takes pictures in, encoders and video write, and animate strings all together.
"""
