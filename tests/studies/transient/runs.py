"""How these tests run a valve in time, and stop it."""

from dbvfiv.studies.session import Session


def transient(model, name="case", output=None, observer=None):
    """A run of a model's case, as the command makes it."""
    session = Session(model.case, name)
    session.model = model
    return session.perform("transient", output, observer)


#: A run of twenty milliseconds with several restart points.
SHORT = {"transient.duration": 0.02, "transient.restart_every": 7, "transient.save_every": 0.005}
