"""How a window is divided: the picture, a column for boxes beside the picture, and a strip for buttons below both."""

from dataclasses import dataclass

ROOMY = (960, 540)  # width and height from which on boxes and buttons have places of their own
COLUMN, STRIP = 368, 50  # pixels
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Area:
    """A rectangle of a window in pixels, from the window's upper left corner."""

    left: int
    top: int
    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    def holds(self, pixel: tuple[float, float]) -> bool:
        """Whether a pixel of the window is in it."""
        x, y = self.inside(pixel)
        return 0.0 <= x < self.width and 0.0 <= y < self.height

    def inside(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """A pixel of the window as a pixel of the area, from its upper left corner."""
        return pixel[0] - self.left, pixel[1] - self.top

    def share(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """A pixel of the window in 0…1 of the area, from its lower left corner."""
        x, y = self.inside(pixel)
        return x / self.width, 1.0 - y / self.height

    def box_of(self, other: "Area") -> Box:
        """Left, top, width and height of another area in shares of this area, from its upper left corner."""
        left, top = (other.left - self.left) / self.width, (other.top - self.top) / self.height
        return left, top, other.width / self.width, other.height / self.height

    def part(self, size: tuple[int, int]) -> "Area":
        """The part of this size at the upper left corner."""
        return Area(self.left, self.top, *size)


@dataclass(frozen=True)
class Layout:
    """The parts of a window. A small window has no column and no strip: its boxes lie over the picture."""

    size: tuple[int, int]
    picture: Area
    column: Area | None
    strip: Area | None

    @staticmethod
    def of(size: tuple[int, int], *, boxes: bool) -> "Layout":
        """The layout of a window of this size, where there are `boxes` to be shown beside the picture."""
        width, height = size
        if width < ROOMY[0] or height < ROOMY[1]:
            return Layout(size, Area(0, 0, width, height), None, None)
        column = Area(0, 0, COLUMN, height - STRIP) if boxes else None
        left = COLUMN if boxes else 0
        strip = Area(0, height - STRIP, width, STRIP)
        return Layout(size, Area(left, 0, width - left, height - STRIP), column, strip)
