"""The command line: it parses, calls and prints.

A command is a function with Typer annotations, named as the command, whose docstring is the help text; `main` lists
them (`studies` makes those of the studies, `terminal` has the arguments and the printing that they share). Modules
import nothing heavy at their top, so that ``dbvfiv --help`` stays quick: a command imports in its body what it needs.

Failures are raised, not printed: ``run`` turns ``CaseError`` into exit status
2, ``SolveError`` into 1, Ctrl-C into 130 and SIGTERM into 143, each with one
sentence on standard error.
"""

from .main import run

__all__ = ["run"]
