"""The counts of the solver of implicit steps: iterations and failures, all of which are reported."""

from dataclasses import dataclass


@dataclass
class SolverReport:
    """Counts over all steps and replicas.

    steps, newton_iterations, linear_iterations   solved steps, and their iterations altogether
    most_newton_iterations                        most iterations of one step, or piece of a step
    cut_steps                                     steps that were cut into pieces, because the whole step was not solved
    gaining_pieces                                smallest pieces, which gained energy nevertheless
    unsolved                                      replicas that stand still because one of their steps was not solved
    fewest_steps                                  steps since the last report of the replica with the fewest
    """

    steps: int = 0
    newton_iterations: int = 0
    linear_iterations: int = 0
    most_newton_iterations: int = 0
    cut_steps: int = 0
    gaining_pieces: int = 0
    unsolved: int = 0
    fewest_steps: int = 0

    def add(self, other: "SolverReport") -> None:
        """Add the counts of another report."""
        self.steps += other.steps
        self.newton_iterations += other.newton_iterations
        self.linear_iterations += other.linear_iterations
        self.most_newton_iterations = max(self.most_newton_iterations, other.most_newton_iterations)
        self.cut_steps += other.cut_steps
        self.gaining_pieces += other.gaining_pieces
        self.unsolved += other.unsolved
