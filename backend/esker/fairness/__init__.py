"""Fair shares of what a server has only so much of, and of the event loop's processor time (decisions 31 and 33).

It knows no other room.
"""
