"""What laws that are made around a channel take over from it."""

from __future__ import annotations

from .channel import Channel
from .law import FlowLaw


class AroundChannel(FlowLaw):
    """A law of a channel with more to it.

    Attributes
    ----------
    channel : Channel
        Its stations, levels and blend of the continuity laws are the law's.
    """

    channel: Channel

    @property
    def count(self) -> int:
        return self.channel.count

    @property
    def terms(self):
        """Those of the channel."""
        return self.channel.terms

    @property
    def back(self) -> float:
        """That of the channel."""
        return self.channel.back

    @property
    def level(self) -> float:
        """That of the channel."""
        return self.channel.level

    @property
    def static(self):
        """That of the channel."""
        return self.channel.static

    @property
    def storage(self) -> float:
        """Blend of the continuity laws."""
        return self.channel.storage
