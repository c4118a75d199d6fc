"""Benchmarks of many servers over one database, and the real servers that they and the tests start."""
