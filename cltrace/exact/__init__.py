"""Exact decisions about rays and surfaces."""
