"""Benchmarks of what a server withstands: attacks at full rate, kills, a full disk."""
