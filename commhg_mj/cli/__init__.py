"""The command line: parses, calls, prints. Bad input exits with 2 and one line that names it."""

import os
import sys

import tyro

from ..base.processes import Terminated, interruptible
from .console import LOG, say
from .measures import Bench, Calibrate, Value
from .missions import Render, Run
from .radio_plans import Compare, Coverage, Fit, Links
from .replays import Cases, Explain
from .training import Curves, Evaluate, Methods, Publish, Train
from .worlds import Figure, Scenarios, World

Command = (
    Run | Render | Explain | Cases | Methods | Train | Curves | Evaluate | Publish | Links | Coverage | Compare | Fit
    | Scenarios | World | Figure | Bench | Calibrate | Value
)  # fmt: skip


DESCRIPTION = "Missions of human operators, aerial and ground robots under limited communication."


def main(arguments=None) -> int:
    """Run one command; the exit code is 2 for bad input, 130 after an interrupt, 143 after SIGTERM."""
    try:
        with interruptible():
            parse(sys.argv[1:] if arguments is None else arguments)()
            sys.stdout.flush()
    except BrokenPipeError:  # the reader of our output, such as head, has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, RuntimeError, OSError, MemoryError, FloatingPointError) as error:
        say(f"commhg-mj: {str(error) or 'not enough memory'}", LOG, style="red")
        return 2
    except KeyboardInterrupt as interrupt:
        say(str(interrupt) or "interrupted", LOG)
        return 143 if isinstance(interrupt, Terminated) else 130
    return 0


def parse(arguments) -> Command:
    """The command that is asked for; in place of options that are not given, a resumed run has its own."""
    command = tyro.cli(Command, prog="commhg-mj", description=DESCRIPTION, args=arguments)
    if isinstance(command, Train) and command.resume:
        return tyro.cli(Train, prog="commhg-mj train", default=command.as_begun(), args=arguments[1:])
    return command
