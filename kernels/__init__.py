"""The OpenCL sources, as package data: `importlib.resources.files("cltrace.kernels")`."""
