"""Order conditions, exactly: of splittings in the algebra of words, of Runge–Kutta methods over rooted trees.

Words: a product of exponentials of drifts A and kicks B, in the order in which they act, is a power series in words of A and B.
The method is of order p when every word of k ≤ p letters has the coefficient 1/k! of exp(A + B). Where forces depend on places
and times alone, the kinetic energy is quadratic, and each bracket with B takes a power of the velocity: brackets of more B
than A + 1 are zero. Two series then agree when their difference lies in the ideal of these brackets.
Sources: Hairer, Lubich & Wanner, Geometric Numerical Integration, §III.3; McLachlan & Quispel, Acta Numerica 11 (2002) 341.
Trees: Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, §II.2.
"""

import itertools
import math
from functools import cache

import numpy as np

LETTERS = (np.array([1.0, 0.0]), np.array([0.0, 1.0]))


def word_coefficients(moves, longest):
    """Coefficients of the words of each length, as arrays of 2ᵏ, in the product of exp(c X); `moves` are (letter, c)."""
    series = [np.zeros(2**k) for k in range(longest + 1)]
    series[0][0] = 1.0
    for letter, c in moves:
        longer = [each.copy() for each in series]
        for k, j in itertools.combinations(range(longest + 1), 2):
            # Words of length k followed by j − k times the letter.
            ending = (2 ** (j - k) - 1) * letter
            longer[j][np.arange(2**k) * 2 ** (j - k) + ending] += series[k] * c ** (j - k) / math.factorial(j - k)
        series = longer
    return series


def moves_of(entries):
    """Drifts (0) and kicks (1) in turn, from the (node, kick, drift) of a splitting."""
    return [move for _node, kick, drift in entries for move in ((1, kick), (0, drift))]


def product(a, b):
    return np.outer(a, b).ravel()


def right_bracket(word):
    """[X₁, [X₂, … X_n]]."""
    result = LETTERS[word[-1]]
    for letter in word[-2::-1]:
        result = product(LETTERS[letter], result) - product(result, LETTERS[letter])
    return result


@cache
def vanishing(length):
    """Orthonormal basis, in columns, of the words of this length that are zero where B depends on places and times alone."""
    found = []
    # Brackets [B, …, [B, A]] of two more B than A are enough: an inner part that is zero already makes the others so.
    for inner in range(4, length + 1, 2):
        for middle in itertools.product((0, 1), repeat=inner - 3):
            if sum(middle) == inner // 2 - 1:
                bracket = right_bracket((1, *middle, 1, 0))
                for before in range(length - inner + 1):
                    left, right = np.eye(2**before), np.eye(2 ** (length - inner - before))
                    found += [product(product(u, bracket), v) for u in left for v in right]
    if not found:
        return np.zeros((2**length, 0))
    rows = np.array(found)
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return vectors[:, values > 1e-9 * values[-1]]


def splitting_defects(entries, longest, *, kicks_of_place):
    """Largest defect in the conditions of each order from 1 to `longest`; less what vanishes for `kicks_of_place`."""
    series = word_coefficients(moves_of(entries), longest)
    defects = []
    for k in range(1, longest + 1):
        defect = series[k] - 1.0 / math.factorial(k)
        if kicks_of_place:
            basis = vanishing(k)
            defect = defect - basis @ (basis.T @ defect)
        defects.append(np.abs(defect).max())
    return defects


@cache
def trees(order):
    """Rooted trees with `order` nodes, each the sorted tuple of the trees on its root."""
    if order == 1:
        return ((),)
    found = set()
    for smaller in range(1, order):
        for branch in trees(smaller):
            for rest in trees(order - smaller):
                found.add(tuple(sorted((branch, *rest))))
    return tuple(sorted(found))


def node_count(tree):
    return 1 + sum(node_count(branch) for branch in tree)


def density(tree):
    """γ: the number of nodes times the densities of the branches."""
    return node_count(tree) * math.prod(density(branch) for branch in tree)


def elementary(tree, a):
    """Elementary weight of every stage: the product over the branches of a · their own."""
    result = np.ones(len(a))
    for branch in tree:
        result = result * (a @ elementary(branch, a))
    return result


def square(rows, stages):
    """Rows of a tableau as a matrix."""
    return np.array([list(row) + [0.0] * (stages - len(row)) for row in rows])
