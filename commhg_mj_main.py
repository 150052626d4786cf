"""Where the command `commhg-mj` begins: outside the package, so that an interrupt is one line while all of it is imported."""

import os
import signal


def main() -> int:
    """Import the command line and run it."""
    if is_ours := signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    from commhg_mj.cli import main as run

    if is_ours:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return run()


def _end(number, frame):
    """On the spot: an exception would get lost, or be turned into another one, in callbacks and C code of imports."""
    os.write(2, b"interrupted\n")
    os._exit(130)
