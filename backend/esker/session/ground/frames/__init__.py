"""From solved levels to the frames that wait for a client's socket.

``feed`` takes levels and gives frames, ``stream`` is one client's, ``tilethread`` is the thread in which all of it is
made, and says whose turn it is. It may know ``contract``, ``events``, ``grid``, ``tiles`` and the ports of ``ground``.
"""
