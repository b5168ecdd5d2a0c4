"""Onset study: loss and regain of stability along one parameter."""
