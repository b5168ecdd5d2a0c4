"""The command line: it parses, calls and prints.

Every module here without a leading underscore is one command of that name. It
defines ``command``, a function with Typer annotations (``_options`` has the
common ones) whose docstring is the help text, and may set ``ORDER``, its place
in the list of commands. It imports nothing heavy, so that ``dbvfiv --help`` stays quick;
what a command does stands in ``_actions``, which is loaded when one runs.

Failures are raised, not printed: ``run`` turns ``CaseError`` into exit status
2, ``SolveError`` into 1, Ctrl-C into 130 and SIGTERM into 143, each with one
sentence on standard error.
"""

from ._run import run

__all__ = ["run"]
