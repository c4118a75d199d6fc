"""The solver on OpenCL devices: devices, queues, memory, programs, and one level at a time (DESIGN 5.3).

It may know ``solve`` and its constraints.
"""
