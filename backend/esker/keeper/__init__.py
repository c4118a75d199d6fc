"""The machine's owner: whoever may read the server's private file (docs/decisions/0035-the-machines-owner.md).

It may know ``contract``, ``document``, ``session`` and ``store``.
"""
