"""Benchmarks of real ground: the patchwork, bases, imports, exports, refinement."""
