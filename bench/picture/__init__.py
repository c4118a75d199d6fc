"""Benchmarks of pictures: the page and the reference renderer, their detail and their cracks."""
