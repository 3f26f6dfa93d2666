"""A Plan on an OpenCL device -> arrays of pixels."""
