"""The case file: typed, unit-aware, every key declared once.

`model.Case()` is the 12-inch valve in its fluid, `dbvfiv.errors.CaseError` the one way in which a case is refused. The
keys of the studies are theirs: the whole case, and what loads one, is `dbvfiv.studies.case`.
"""
