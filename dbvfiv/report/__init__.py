"""One page that a person reads: whether, where and how a valve vibrates, and how far to trust each answer.

`gather` runs the studies, each into a file beside the page; `parts` turn their results into headings, sentences,
tables and figures; `page` puts them into one HTML file that needs no network.
"""

from .gather import Gathered, Runs, gather
from .page import write_page, write_parts

__all__ = ["Gathered", "Runs", "gather", "write_page", "write_parts"]
