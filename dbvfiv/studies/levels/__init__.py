"""Strain levels of the rubbers that agree with the strains their layers see."""
