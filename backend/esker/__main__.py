"""``python -m esker`` is the same as ``esker``. What is imported here is little: until it is there Ctrl-C shows it."""

import sys

from esker.process import interrupt


def main() -> int:
    """Runs the command on the command line; returns the exit status. Ctrl-C never shows where the program was."""
    interrupt.ends()
    from esker.cli.main import main as command

    try:
        interrupt.raises()
        return command()
    except KeyboardInterrupt:
        return interrupt.STOPPED
    finally:
        interrupt.ends()


if __name__ == "__main__":
    sys.exit(main())
