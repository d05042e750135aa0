"""Rows of a list, one of which is marked: the rows around the marked row are shown where not all of them fit."""


class MarkedRows:
    """`count` rows, of which `marked` is the number of the marked row."""

    def __init__(self) -> None:
        """There is no row yet."""
        self.count, self.marked = 0, 0

    def begin(self, count: int, marked: int = 0) -> None:
        """Have so many rows from now on."""
        self.count, self.marked = count, min(max(marked, 0), max(count - 1, 0))

    def step(self, rows: int) -> None:
        """Move the mark by rows, round the ends."""
        if self.count:
            self.marked = (self.marked + rows) % self.count

    def scroll(self, rows: int) -> None:
        """Move the mark by rows, not beyond the ends."""
        self.marked = min(max(self.marked + rows, 0), max(self.count - 1, 0))

    def visible(self, room: int) -> range:
        """The numbers of the rows that are shown where there is room for so many, at least one."""
        shown = max(1, min(self.count, room))
        first = min(max(0, self.marked - shown // 2), max(0, self.count - shown))
        return range(first, min(first + shown, self.count))
