"""Numbers that a sentence compares, written with as many digits as a reader needs to see that they differ."""

MOST_DIGITS = 17  # with which every number of 64 bits has a text of its own


def told_apart(*values: float, digits: int = 6) -> tuple[str, ...]:
    """The values with so many significant digits, and with more where two values that differ would read alike.

    Rounding to the same number of digits keeps an order, so that texts that differ are also in the order of the values.
    """
    different = len(set(map(float, values)))
    for count in range(digits, MOST_DIGITS + 1):
        texts = tuple(f"{value:.{count}g}" for value in values)
        if len(set(texts)) >= different:
            break
    return texts
