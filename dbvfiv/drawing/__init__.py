"""How figures look and are written, and views of the valve that several studies share."""
