"""An observer that interrupts a run as Ctrl-C does."""

from dbvfiv.observer import Observer


class Stop(Observer):
    """Interrupt after some items, or at the progress after them that begins with a text.

    Attributes
    ----------
    seen : list
        Items so far, or their values where they have one.
    ended : bool or None
        Word of the study's end: it was interrupted.
    """

    def __init__(self, after: int = 10**9, text: str = ""):
        self.left, self.text, self.seen, self.ended = after, text, [], None

    def item(self, result):
        self.seen.append(getattr(result, "value", result))
        self.left -= 1
        if not (self.left or self.text):
            raise KeyboardInterrupt

    def progress(self, text):
        if self.text and self.left <= 0 and text.startswith(self.text):
            raise KeyboardInterrupt

    def end(self, interrupted):
        self.ended = interrupted
