"""The journal as people remember it: entries of the activity log, their words, and which old gestures can be folded.

It may know the document.
"""
