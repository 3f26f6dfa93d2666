"""A Scene and what is wanted of it -> a Plan: arrays, features and constants, in numpy alone."""
