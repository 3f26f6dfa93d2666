"""One module a shape: what the kernel needs of it, and its silhouette as seen from a point or along a direction."""
