"""How these tests run a valve in time, and stop it."""

from dbvfiv.studies.session import Session


def transient(model, name="case", output=None, observer=None):
    """A run of a model's case, as the command makes it."""
    session = Session(model.case, name)
    session.model = model
    return session.perform("transient", output, observer)


class Stop:
    """An observer that interrupts after some steps."""

    def __init__(self, after):
        self.left = after

    def item(self, row):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt

    def __getattr__(self, name):
        return lambda *arguments: None


#: A run of twenty milliseconds with several restart points.
SHORT = {"transient.duration": 0.02, "transient.restart_every": 7, "transient.save_every": 0.005}
