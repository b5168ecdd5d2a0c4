"""Build the command list, run one, and translate every failure into a sentence and an exit status."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from types import FrameType
from typing import Annotated, Any

import typer

from .. import __version__
from ..errors import CaseError, DiskFull, SolveError
from . import case, materials, pages, results, studies
from .terminal import Stopped

# Typer brings its own Click in newer versions and uses the separate package in older ones.
_UsageProblem = typer.BadParameter.__mro__[2]

#: Commands that the help lists before and behind those of the studies.
_BEFORE = (case.case, materials.damping, materials.fit, materials.ply, pages.report)
_AFTER = (
    studies.resume,
    results.verdict,
    results.plot,
    results.compare,
    results.life,
    results.export,
    results.cfd,
    results.info,
    pages.app,
    case.doctor,
    pages.reproduce,
)


def _version(show: bool) -> None:
    if show:
        print(f"dbvfiv {__version__}")
        raise typer.Exit()


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Fluid-induced vibration of duckbill valves.

    A CASE is a TOML file; without one the 12-inch valve is taken.
    Start with `dbvfiv case --new my.toml`, check the machine with `dbvfiv doctor`.
    """


@cache
def build() -> Any:
    """Parser of all commands, in the order of their help; one for every command line of a process."""
    commands_of = typer.Typer(
        add_completion=True, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False
    )
    commands_of.callback()(_root)
    commands = [(command.__name__, command) for command in _BEFORE]
    commands += studies.study_commands()
    commands += [(command.__name__, command) for command in _AFTER]
    for name, command in commands:
        commands_of.command(name, no_args_is_help=False)(command)
    return typer.main.get_command(commands_of)


def run(arguments: Sequence[str], leaving: bool = False) -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str
        Without the program's name.
    leaving : bool
        True where the process ends with it: SIGTERM that comes again meanwhile does not change its status.

    Returns
    -------
    int
        Exit status: 0 done, 1 no solution or a failing machine, 2 a case or
        an argument that cannot be used, 3 an error of the program, 130 interrupted, 143 terminated.
    """
    with Ending(leaving) as ending:
        return _outcome(arguments, ending)


class Ending:
    """SIGTERM as Ctrl-C while a command runs: what was found is kept.

    Attributes
    ----------
    terminated : bool
        Whether SIGTERM has come.
    """

    #: A signal that comes again within this time is the same one sent twice, as `timeout` and many job systems do, s.
    SAME = 2.0

    def __init__(self, leaving: bool = False):
        self.terminated, self._leaving = False, leaving
        self._since = -math.inf
        self._before: Any = None
        self._told = sys.unraisablehook

    def __enter__(self) -> Ending:
        if threading.current_thread() is threading.main_thread():
            before = signal.getsignal(signal.SIGTERM)
            if before is signal.SIG_DFL:  # a handler that is set already, or none wanted, stays
                self._before = signal.signal(signal.SIGTERM, self._interrupt)
            sys.unraisablehook = self._send_again
        return self

    def __exit__(self, *error: object) -> None:
        if sys.unraisablehook == self._send_again:
            sys.unraisablehook = self._told
        if self._before is not None:
            signal.signal(signal.SIGTERM, signal.SIG_IGN if self.terminated and self._leaving else self._before)

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        self.terminated = True
        last, self._since = self._since, time.monotonic()
        if self._since - last > self.SAME:
            raise KeyboardInterrupt

    def _send_again(self, ignored: sys.UnraisableHookArgs) -> None:
        """Send a signal again whose interruption came in a callback, as of the garbage collector: Python ignores what
        these raise.
        """
        if not isinstance(ignored.exc_value, KeyboardInterrupt):
            self._told(ignored)
            return
        self._since = -math.inf
        again = threading.main_thread().ident, signal.SIGTERM if self.terminated else signal.SIGINT
        threading.Timer(0.01, signal.pthread_kill, again).start()


def _outcome(arguments: Sequence[str], ending: Ending) -> int:
    """Exit status of a command line; failures become sentences."""
    try:
        status = build().main(list(arguments), prog_name="dbvfiv", standalone_mode=False)
        if status == 130:  # newer Typer swallows Ctrl-C
            raise KeyboardInterrupt
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except CaseError as error:
        return _report(str(error), 2)
    except (SolveError, DiskFull) as error:
        return _report(str(error), 1)
    except (KeyboardInterrupt, typer.Abort, Stopped) as error:
        how, status = ("Terminated", 143) if ending.terminated else ("Interrupted", 130)
        return _report(f"{how}; {error}." if isinstance(error, Stopped) else f"{how}.", status)
    except typer.Exit as leave:
        return leave.exit_code
    except _UsageProblem as problem:
        if type(problem).__name__ == "NoArgsIsHelpError":
            print(problem.format_message())
            return 2
        text = " ".join(problem.format_message().split()).rstrip(".?").replace(". ", "; ")
        return _report(f"{text}; `dbvfiv --help` lists what there is.", 2)
    except BrokenPipeError:
        _let_reader_go()
        return 1
    except OSError as error:
        name = f" {error.filename!r}" if error.filename else ""
        return _report(f"The file{name} cannot be used ({error.strerror or error}).", 1)
    except Exception as error:  # the last line of defence: no traceback unless asked for
        if os.environ.get("DBVFIV_DEBUG"):
            traceback.print_exc()
        detail = " ".join(str(error).split())[:200].rstrip(".")
        return _report(
            f"The program failed unexpectedly ({type(error).__name__}: {detail}); "
            "set DBVFIV_DEBUG=1 for the details to report.",
            3,
        )


def _report(sentence: str, status: int) -> int:
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _let_reader_go()
    with suppress(BrokenPipeError):
        print(sentence, file=sys.stderr)
    return status


def _let_reader_go() -> None:
    """Keep Python from complaining at exit that the reader has left (`dbvfiv ... | head`)."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
