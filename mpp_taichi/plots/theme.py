"""Colours of plots: dark beside a scene, light on paper."""

from dataclasses import dataclass

Rgb = tuple[int, int, int]
# Okabe & Ito, "Color Universal Design" (2008), which the colour-blind can tell apart. Theory is black or white.
SKY, ORANGE, GREEN, VERMILION = (86, 180, 233), (230, 159, 0), (0, 158, 115), (213, 94, 0)
PURPLE, YELLOW, BLUE = (204, 121, 167), (240, 228, 66), (0, 114, 178)


@dataclass(frozen=True)
class Theme:
    """Colours of the parts of a panel; `curves` are taken in turn."""

    background: Rgb
    field: Rgb
    grid: Rgb
    text: Rgb
    faint: Rgb
    theory: Rgb  # a line over a histogram
    band: Rgb  # a broad line below a curve
    curves: tuple[Rgb, ...]

    def curve(self, number: int) -> Rgb:
        """The colour of a curve."""
        return self.curves[number % len(self.curves)]


DARK = Theme(
    background=(14, 15, 21),
    field=(22, 24, 33),
    grid=(48, 51, 64),
    text=(228, 230, 236),
    faint=(160, 164, 176),
    theory=(255, 255, 255),
    band=(104, 109, 128),
    curves=(SKY, ORANGE, (0, 190, 140), VERMILION, PURPLE, YELLOW),
)
LIGHT = Theme(
    background=(255, 255, 255),
    field=(250, 250, 252),
    grid=(222, 224, 230),
    text=(20, 20, 26),
    faint=(90, 94, 104),
    theory=(0, 0, 0),
    band=(190, 194, 206),
    curves=(BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY),
)
