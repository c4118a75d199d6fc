"""A rate with something saved up (DESIGN 4). The clock is injected."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class TokenBucket:
    """``rate`` tokens a second, at most ``burst`` saved up. Starts full."""

    rate: float
    burst: float
    _tokens: float = field(default=-1.0, init=False)
    _at: float = field(default=0.0, init=False)

    def take(self, now: float, n: float = 1.0) -> bool:
        """Takes ``n`` tokens at time ``now`` (seconds, never running backwards); False when there are too few."""
        if self._tokens < 0:
            self._tokens = self.burst
        else:
            self._tokens = min(self.burst, self._tokens + max(0.0, now - self._at) * self.rate)
        self._at = now
        if self._tokens < n:
            return False
        self._tokens -= n
        return True
