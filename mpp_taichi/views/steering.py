"""Steering: parameters that are at an end of their range while a key is held, such as the thrust of a rocket."""

from collections.abc import Iterable, Sequence

from mpp_taichi.views.slider_panel import Knob


class Steering:
    """The parameters that have keys. A move is told only when a key goes down or up, so that a log has few of them."""

    def __init__(self, knobs: Sequence[Knob]) -> None:
        """No key is held; without a key a parameter is where it is now."""
        self._rest = {knob: knob.read() for knob in knobs if knob.keys}
        self._ways = dict.fromkeys(self._rest, 0)

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that steer."""
        return tuple(key for knob in self._rest for key in knob.keys)

    def moves(self, held: Iterable[str]) -> dict[str, float]:
        """The parameters that a key moves now, with their new values; both keys of a parameter cancel each other."""
        found, down = {}, set(held)
        for knob, rest in self._rest.items():
            less, more = knob.keys
            way = (more in down) - (less in down)
            if way != self._ways[knob]:
                self._ways[knob] = way
                found[knob.path] = knob.high if way > 0 else knob.low if way < 0 else rest
        return found
