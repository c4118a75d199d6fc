"""Pictures that people see: previews of links, cards, the gallery, turntables.

It may know the reference renderer beside it.
"""
