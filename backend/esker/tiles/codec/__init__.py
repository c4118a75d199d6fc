"""From samples to bytes: prediction, filters, entropy coding, and frames (DESIGN 6).

It may know the contract and the compiled loops beside it.
"""
