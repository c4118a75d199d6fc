"""A live terrain: ``connect`` and all that it answers, over a websocket of its own and HTTP.

``connection`` is the thread that holds the socket; ``client`` what a person calls. It may know what ``api`` may know.
"""
