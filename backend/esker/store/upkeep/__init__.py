"""What a store does beside serving: copies, restoring, migrations, folding, and the end of what nobody needs.

It may know the store.
"""
