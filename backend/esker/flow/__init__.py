"""Running water on integer heights: receivers, lakes, drainage area, rivers as lines.

``water`` is its front. Heights are integers in [row, col] order, row 0 south, so that no last bit of a float decides
where water goes; docs/water.md says the mathematics. It may know ``compiled`` and ``contract``.
"""
