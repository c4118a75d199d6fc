"""The document as members hold it: the welcome, what was missed, each tick's ops, and what a link to look shows.

``replicas`` decides what a member is sent, ``recent`` keeps it as text, ``viewing`` leaves out what is not shown to
viewers, ``earlier`` is for whoever looks at the history. It may know ``members`` and what those may know.
"""
