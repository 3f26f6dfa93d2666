"""A Plan on an OpenCL device -> arrays of pixels."""

# Both tell the drivers where to look, so they come before anything that loads one.
from cltrace.run import caches as caches
from cltrace.run import vendors as vendors
