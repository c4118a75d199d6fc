"""One elevation grid by itself: its stored form, mipmaps, patches, and their own errors (paper 2, 3.1 and 4.1).

It knows no other grid.
"""
