"""Benchmarks: ``esker bench NAME --json``. Each module has ``main(argv) -> int``; results are kept in bench/results.

It may know every room that ranks below it.
"""
