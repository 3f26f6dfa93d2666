"""A Plan on an OpenCL device -> arrays of pixels."""

# Both set what drivers look at when they are loaded, so they come before anything that loads one.
from cltrace.run import caches as caches
from cltrace.run import vendors as vendors
