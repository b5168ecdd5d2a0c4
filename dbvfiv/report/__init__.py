"""One page that a person reads: whether a valve opens, chatters, closes and seals, and how far to trust each answer.

`gather` runs the studies, each into a file beside the page; `answers` answers the four questions; `parts` turn results
into headings, sentences, tables and figures; `page` puts them into one HTML file that needs no network.
"""

from .gather import Gathered, gather
from .page import find_printers, write_page, write_parts, write_pdf

__all__ = ["Gathered", "find_printers", "gather", "write_page", "write_parts", "write_pdf"]
