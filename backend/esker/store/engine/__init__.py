"""What a store runs on: the engines behind their ports, leases of terrains, and the lock of a data folder.

It may know ``contract``, ``document``, ``process`` and what the store does for a database: migrations, copies, space.
"""
