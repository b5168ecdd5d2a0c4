"""Base class of flow laws that extend a channel and take its properties over."""

from __future__ import annotations

from .channel import Channel
from .law import FlowLaw


class AroundChannel(FlowLaw):
    """Flow law that extends a channel, as by an elastic line or a compressible fluid.

    Attributes
    ----------
    channel : Channel
        Gives the law its stations, levels and blend of the continuity laws.
    """

    channel: Channel

    @property
    def count(self) -> int:
        return self.channel.count

    @property
    def terms(self):
        """Loss and inertance terms of the channel."""
        return self.channel.terms

    @property
    def back(self) -> float:
        """Driving pressure at which nothing flows, Pa; that of the channel."""
        return self.channel.back

    @property
    def level(self) -> float:
        """Hydrostatic pressure between the ends of the passage, Pa; that of the channel."""
        return self.channel.level

    @property
    def static(self):
        """Hydrostatic pressures (m,) across the wall at the stations, Pa; those of the channel."""
        return self.channel.static

    @property
    def storage(self) -> float:
        """Blend of the continuity laws."""
        return self.channel.storage
