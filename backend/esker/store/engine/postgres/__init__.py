"""PostgreSQL as the engine of a store that several servers share: connections, fenced commits, leases, migrations.

It may know the ports and the leases of the engine, and what the store does for a database.
"""
