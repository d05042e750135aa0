"""Compressed bytes, as arrays that a record can hold; at the fastest level of zlib, since a run waits for it."""

import zlib

import numpy as np

LEVEL = 1  # successive pictures differ little: a higher level costs more time than it saves bytes


def compressed(data: bytes) -> np.ndarray:
    """The bytes, compressed, as an array of uint8."""
    return np.frombuffer(zlib.compress(data, LEVEL), np.uint8)


def decompressed(array: np.ndarray, length: int) -> bytes:
    """The bytes of `compressed`, which are known to be so many; no more memory is taken, whatever the array holds.

    Raises:
        ValueError: the array is damaged, or holds another number of bytes.
    """
    try:
        data = zlib.decompressobj().decompress(array.tobytes(), length + 1)
    except zlib.error as error:
        raise ValueError("damaged compressed bytes") from error
    if len(data) != length:
        raise ValueError(f"compressed bytes of another length than {length:,}")
    return data
