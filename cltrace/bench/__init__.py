"""The benchmark: run time against error. Nothing in cltrace itself imports it."""
