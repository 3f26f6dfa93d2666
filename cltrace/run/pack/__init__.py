"""Views of many surfaces, made on a device with numpy's bits: the kernels of kernels/pack, and what runs them."""
