"""A Plan on an OpenCL device -> arrays of pixels."""

# It sets what drivers look at when they are loaded, so it comes before anything that loads one.
from cltrace.run import caches as caches
