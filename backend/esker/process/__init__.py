"""What a process asks of its operating system: locks, memory, priorities, limits, signals (decision 28).

No other room imports ``fcntl``, ``resource``, ``signal`` or ``msvcrt``, calls ``os.sysconf`` and its like,
or reads /proc. It knows no other room.
"""
