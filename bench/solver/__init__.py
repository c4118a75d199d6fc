"""Benchmarks of the solver: its time, its memory traffic, its accuracy, and scenes drawn against it."""
