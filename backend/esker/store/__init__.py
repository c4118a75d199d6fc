"""What outlives the process: the journal, links, backups, elevation grids and previews, on the server's disk.

It alone speaks SQLite, and writes into the data folder. It may know ``contract``, ``document``, ``patchwork`` and
``process``.
"""
