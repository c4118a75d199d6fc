"""Ctrl-C where a command has nothing to tidy up: it ends the process without a word.

It stands before everything else that a command imports, so it imports nothing but ``signal``.
"""

import signal

STOPPED = 130
"""Exit status of a command that Ctrl-C ended: what shells say of a program that ended by that signal."""


def ends() -> None:
    """From now on Ctrl-C ends this process at once, unless it was started so that Ctrl-C is ignored.

    `make run` starts Python with the signal held back, where the system can: what comes before this is obeyed here.
    """
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def raises() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt in the main thread, unless it is ignored."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def ignored() -> None:
    """From now on Ctrl-C does nothing here: whoever started this process is interrupted too, and ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
