"""Ground to be held in the hand: contour maps to scale on paper, and solids for printers.

``layout`` lays a map out as shapes and words in millimetres, which ``svg`` and ``pdf`` write; ``contours`` finds its
lines; ``solid`` writes STL. It may know what ``exporting`` may.
"""
