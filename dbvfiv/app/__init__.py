"""The valve in the browser: a page served on this machine; see `dbvfiv.app.server`."""
