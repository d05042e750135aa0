"""Relief: the slopes of a body's surface, from a height map, a normal map or a pattern. NumPy on the host."""

import numpy as np

HEIGHT = 0.02  # radii from the black to the white of a height map, at a strength of 1
STEEPEST = 4.0  # slopes are kept within −STEEPEST…STEEPEST
NARROWEST = 0.1  # cosine of the latitude beyond which a parallel counts as no shorter: its texels there are mere noise
LEVEL = 32768  # code of a slope of 0
STEP = STEEPEST / 32767.0  # of the slope, between two codes


def slopes_of_heights(height: np.ndarray, strength: float) -> np.ndarray:
    """Slopes to the east and to the north of heights within 0…1, shape (rows, columns, 2), by Sobel's operator.

    Sobel's operator is a central difference over two texels, smoothed across by 1, 2, 1.  [Sobel & Feldman 1968, Stanford AI
    Project] Longitude is periodic; beyond the first and the last row the heights go on as they are in this row.
    """
    rows, columns = height.shape
    around = np.pad(np.pad(np.asarray(height, dtype=float), ((1, 1), (0, 0)), mode="edge"), ((0, 0), (1, 1)), mode="wrap")
    across = around[:, 2:] - around[:, :-2]
    down = around[2:] - around[:-2]
    east = (across[:-2] + 2.0 * across[1:-1] + across[2:]) / 8.0  # for each texel
    north = -(down[:, :-2] + 2.0 * down[:, 1:-1] + down[:, 2:]) / 8.0
    parallel = np.maximum(np.cos(np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)), NARROWEST)[:, None]
    scale = strength * HEIGHT
    return np.stack([scale * east * columns / (2.0 * np.pi * parallel), scale * north * rows / np.pi], axis=2)


def slopes_of_normals(picture: np.ndarray, strength: float) -> np.ndarray:
    """Slopes to the east and to the north of a normal map, uint8: red to the east, green to the north, blue outwards.

    The texel is 127.5 (n + 1); 127 and 128 both stand for 0, so that a level map has no slope.
    """
    component = np.asarray(picture, dtype=float) - 127.5
    component = np.sign(component) * np.maximum(np.abs(component) - 0.5, 0.0)
    return -strength * component[..., :2] / np.maximum(component[..., 2:3], 1.0)


def slopes_of_picture(picture: np.ndarray, strength: float) -> np.ndarray:
    """Slopes of a picture, uint8, shape (rows, columns, 3): a height map where it is grey, else a normal map."""
    grey = (picture[..., 0] == picture[..., 1]).all() and (picture[..., 1] == picture[..., 2]).all()
    return slopes_of_heights(picture[..., 0] / 255.0, strength) if grey else slopes_of_normals(picture, strength)


def packed_slopes(slopes: np.ndarray) -> np.ndarray:
    """The slope to the east in the lower 16 bits and the slope to the north in the upper 16 bits, uint32."""
    code = (np.rint(np.clip(slopes, -STEEPEST, STEEPEST) / STEP) + LEVEL).astype(np.uint32)
    return np.asarray(code[..., 0] | code[..., 1] << 16)
