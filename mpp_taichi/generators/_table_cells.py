"""Names in the cells of a table, which no program of tables may take for a formula."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "'")  # what a formula begins with, and the mark itself


def as_word(name: str) -> str:
    """The name, after an apostrophe where it begins like a formula, as OWASP advises against formulas in CSV files."""
    return f"'{name}" if name.startswith(_FORMULA) else name


def from_word(cell: str) -> str:
    """The name in a cell that `as_word` wrote."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell
