"""Benchmarks of rooms: a start, what people wait for, and what a server holds."""
