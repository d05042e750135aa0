"""Mutants of what goes wrong in physics and in tables: factors, signs, indices, orders, neighbours, ends, stale values.

They are found in the syntax tree, so that code inside kernels is host code like any other, and change only the characters of
one expression or statement.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator

from mutation.source import Mutant, Source

Change = tuple[str, ast.AST, str]  # operator, the node that is replaced, and by which text
ARITHMETIC = (ast.Add, ast.Sub, ast.Mult, ast.Div)
SYMMETRIC = {"min", "max", "minimum", "maximum", "hypot", "dot", "isclose", "allclose", "isinstance", "zip", "gcd", "lcm"}
OTHER_FUNCTION = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "floor": "ceil",
    "ceil": "floor",
    "sin": "cos",
    "cos": "sin",
    "any": "all",
    "all": "any",
    "mean": "median",
    "sum": "max",
    "std": "var",
    "var": "std",
    "argmin": "argmax",
    "argmax": "argmin",
    "sqrt": "abs",
    "sorted": "list",
    "cumsum": "array",
    "lstrip": "strip",
    "rstrip": "strip",
    "startswith": "endswith",
    "hstack": "vstack",
}
OTHER_NAME = {
    "position": "velocity",
    "velocity": "position",
    "mass": "radius",
    "charge": "mass",
    "lower": "upper",
    "upper": "lower",
    "minimum": "maximum",
    "maximum": "minimum",
    "kinetic_energy": "potential_energy",
    "potential_energy": "kinetic_energy",
    "total_energy": "kinetic_energy",
    "momentum": "angular_momentum",
    "start": "end",
    "first": "last",
    "x": "y",
    "y": "x",
    "z": "y",
}


def own_mutants(source: Source) -> Iterator[Mutant]:
    """Every mutant of the module by the operators of this file."""
    for node in ast.walk(source.tree):
        for operator, replaced, text in _changes(source, node):
            start, end = source.span(replaced)
            if source.is_open(start, end) and text != source.text[start:end]:
                yield Mutant(source.path, source.line_of(start), operator, start, end, text)


def _changes(source: Source, node: ast.AST) -> Iterator[Change]:
    for find in FINDERS:
        yield from find(source, node)


def _factors(source: Source, node: ast.AST) -> Iterator[Change]:
    """A whole term twice as large, or of the other sign; a number a tenth larger."""
    above = source.parent.get(node)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ARITHMETIC) and not isinstance(above, ast.BinOp):
        term = source.text_of(node)
        yield "factor", node, f"(2 * ({term}))"
        yield "sign", node, f"(-({term}))"
    if isinstance(node, ast.Constant) and type(node.value) is float and node.value:
        yield "number", node, f"(1.1 * {source.text_of(node)})"
    if isinstance(node, ast.Return) and isinstance(node.value, ast.Call) and _returns(source, node) == "float":
        yield "factor", node.value, f"(2 * {source.text_of(node.value)})"


def _returns(source: Source, node: ast.AST) -> str:
    while node in source.parent and not isinstance(node, ast.FunctionDef):
        node = source.parent[node]
    returns = getattr(node, "returns", None)
    return ast.unparse(returns) if returns is not None else ""


def _orders(source: Source, node: ast.AST) -> Iterator[Change]:
    """Two neighbours of a call, a tuple, a list or the values of a dictionary that change places."""
    if isinstance(node, ast.Call) and _name(node.func) not in SYMMETRIC:
        row = node.args
    elif isinstance(node, (ast.Tuple, ast.List)) and isinstance(node.ctx, ast.Load):
        row = node.elts
    elif isinstance(node, ast.Dict):
        row = node.values
    else:
        return
    for first, second in zip(row, row[1:]):
        if isinstance(first, ast.Starred) or isinstance(second, ast.Starred):
            continue
        between = source.text[source.span(first)[1] : source.span(second)[0]]
        joined = ast.Expr(lineno=first.lineno, col_offset=first.col_offset)
        joined.end_lineno, joined.end_col_offset = second.end_lineno, second.end_col_offset
        yield "order", joined, source.text_of(second) + between + source.text_of(first)


def _neighbours(source: Source, node: ast.AST) -> Iterator[Change]:
    """Another attribute, key or index of the same thing: the field, the column or the particle beside it."""
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
        named = ast.unparse(node.value)
        called = _is_called(source, node)
        others = {other for other, is_called in _attributes(source)[named] if is_called == called} - {node.attr}
        if node.attr in OTHER_NAME and not called:
            others.add(OTHER_NAME[node.attr])
        for other in sorted(others)[:4]:
            yield "neighbour", node, source.text_of(node.value) + "." + other
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str):
        for other in sorted(_keys(source)[ast.unparse(node.value)] - {node.slice.value})[:4]:
            yield "neighbour", node.slice, repr(other)
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Name):
        for other in sorted(_indices(source, node) - {node.slice.id}):
            yield "index", node.slice, other


def _is_called(source: Source, node: ast.AST) -> bool:
    above = source.parent.get(node)
    return isinstance(above, ast.Call) and above.func is node


def _attributes(source: Source) -> dict[str, set[tuple[str, bool]]]:
    """By the text before the dot: the names after it in this module, and whether each is called."""
    if not hasattr(source, "attributes"):
        source.attributes = defaultdict(set)
        for node in ast.walk(source.tree):
            if isinstance(node, ast.Attribute):
                source.attributes[ast.unparse(node.value)].add((node.attr, _is_called(source, node)))
    return source.attributes


def _keys(source: Source) -> dict[str, set[str]]:
    """By the text before the bracket: the texts between the brackets in this module."""
    if not hasattr(source, "keys"):
        source.keys = defaultdict(set)
        for node in ast.walk(source.tree):
            if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str):
                source.keys[ast.unparse(node.value)].add(node.slice.value)
    return source.keys


def _indices(source: Source, node: ast.AST) -> set[str]:
    """Names that stand alone between brackets in the same function."""
    while node in source.parent and not isinstance(node, ast.FunctionDef):
        node = source.parent[node]
    subscripts = (each for each in ast.walk(node) if isinstance(each, ast.Subscript))
    return {each.slice.id for each in subscripts if isinstance(each.slice, ast.Name)}


def _ends(source: Source, node: ast.AST) -> Iterator[Change]:
    """A loop or a slice that begins or ends one too early or too late; the first row for the last."""
    if isinstance(node, ast.Call) and _name(node.func) == "range" and not any(isinstance(a, ast.Starred) for a in node.args):
        last = node.args[min(1, len(node.args) - 1)]
        yield "end", last, f"({source.text_of(last)}) - 1"
        if len(node.args) == 1:
            yield "end", last, f"1, {source.text_of(last)}"
    if isinstance(node, ast.Slice):
        for bound in (node.lower, node.upper):
            if bound is not None:
                yield "end", bound, f"({source.text_of(bound)}) + 1"
    if isinstance(node, ast.Subscript) and ast.unparse(node.slice) in ("-1", "0"):
        yield "end", node.slice, {"-1": "0", "0": "-1"}[ast.unparse(node.slice)]


def _functions(source: Source, node: ast.AST) -> Iterator[Change]:
    """Another function of the same family; a keyword that is forgotten."""
    if not isinstance(node, ast.Call):
        return
    name = _name(node.func)
    if name in OTHER_FUNCTION:
        yield "function", node.func, source.text_of(node.func)[: -len(name)] + OTHER_FUNCTION[name]
    if name == "abs" and len(node.args) == 1:
        yield "function", node, f"({source.text_of(node.args[0])})"
    if name not in ("param", "field", "add_argument") and len(node.args) + len(node.keywords) > 1:
        for keyword in node.keywords:
            if keyword.arg is not None and keyword is not node.keywords[0] and len(node.keywords) > 1:
                yield "keyword", keyword, ""
            elif keyword.arg is not None and node.args:
                start, end = source.span(node.args[-1])[1], source.span(keyword)[1]
                if source.text[start:end].lstrip().startswith(","):
                    gone = ast.Expr(lineno=node.args[-1].lineno, col_offset=node.args[-1].col_offset)
                    gone.end_lineno, gone.end_col_offset = keyword.end_lineno, keyword.end_col_offset
                    if source.is_open(*source.span(keyword)):
                        yield "keyword", gone, source.text_of(node.args[-1])


def _conditions(source: Source, node: ast.AST) -> Iterator[Change]:
    """One part of a condition that is forgotten; one branch that is always taken."""
    if isinstance(node, ast.BoolOp):
        for left in range(len(node.values)):
            word = " and " if isinstance(node.op, ast.And) else " or "
            kept = [source.text_of(value) for number, value in enumerate(node.values) if number != left]
            yield "condition", node, word.join(kept)
    if isinstance(node, ast.IfExp):
        yield "condition", node, f"({source.text_of(node.body)})"
        yield "condition", node, f"({source.text_of(node.orelse)})"
    if isinstance(node, ast.comprehension):
        for test in node.ifs:
            yield "condition", test, "True"


def _stale(source: Source, node: ast.AST) -> Iterator[Change]:
    """A statement that is forgotten: an attribute or an entry is not renewed, a call is not made."""
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    if isinstance(node, ast.AugAssign):
        yield "forgotten", node, "pass"
    elif isinstance(node, ast.Assign) and isinstance(target, (ast.Attribute, ast.Subscript)):
        if isinstance(target, ast.Subscript) or _times_assigned(source, target.attr) > 1:
            yield "forgotten", node, "pass"
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield "forgotten", node, "pass"


def _times_assigned(source: Source, attribute: str) -> int:
    nodes = ast.walk(source.tree)
    return sum(isinstance(each, ast.Attribute) and each.attr == attribute and isinstance(each.ctx, ast.Store) for each in nodes)


def _name(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


FINDERS = (_factors, _orders, _neighbours, _ends, _functions, _conditions, _stale)
