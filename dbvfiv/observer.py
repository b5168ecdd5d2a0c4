"""Reports of a running study to the outside: progress bars, files and plots are observers."""

from __future__ import annotations


class Observer:
    """Does nothing; override what is of interest. Any method may raise KeyboardInterrupt to stop a run between two
    steps.
    """

    def begin(self, study: str, total: int | None) -> None:
        """A study starts; `total` items are expected if that is known."""

    def progress(self, text: str) -> None:
        """A step inside an item was made."""

    def item(self, result: object) -> None:
        """An item (a state, a mode, a step) is finished."""

    def warn(self, sentence: str) -> None:
        """Something the user should know, though the run goes on."""

    def end(self, interrupted: bool) -> None:
        """The study is over."""


class Observers(Observer):
    """Several observers as one, told in order."""

    def __init__(self, *members: Observer):
        self.members = members

    def begin(self, study, total):
        for member in self.members:
            member.begin(study, total)

    def progress(self, text):
        for member in self.members:
            member.progress(text)

    def item(self, result):
        for member in self.members:
            member.item(result)

    def warn(self, sentence):
        for member in self.members:
            member.warn(sentence)

    def end(self, interrupted):
        for member in self.members:
            member.end(interrupted)
