"""People and ops: open rooms with their documents and members, connections, views of history, who may take how much.

``room`` alone changes a document that is open; ``core`` holds its rules without time, ``protocol`` one connection
without I/O. It may know ``session.ground``, which does not know it, and what ``session`` may know.
"""
