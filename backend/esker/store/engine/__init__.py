"""What a store runs on: leases of terrains, the lock of a data folder, and the engines behind their ports.

It may know ``contract``, ``document`` and ``process``; it never knows the rest of the store.
"""
