"""Formulas of forces: a text of the scene becomes a law, with the derivatives that methods ask for.

    fields.py        the keys of a scene that hold formulas, and the numbers of their parameters
    laws.py          the law of a force, and the faults of its text
    grammar.py       text → SymPy, bounded in size, without any execution of the text
    time_limit.py    no formula takes longer than some seconds
    pair_law.py      a potential of the distance → shape, slope, curvature and energy of a pair force
    external_law.py  a potential or an acceleration at a place → acceleration and its derivatives in time
    program.py       SymPy → a list of steps, which NumPy and kernels compute alike
    array_steps.py   the steps for NumPy; those of kernels are in arithmetic/formula_steps.py

SymPy is imported only where a scene has such a force.
"""
