"""What the solver of implicit steps did; iterations and failures are told, never passed over."""

from dataclasses import dataclass


@dataclass
class SolverReport:
    """Counts over all steps and replicas.

    steps, newton_iterations, linear_iterations   solved steps, and what they took together
    most_newton_iterations                        in one step, or piece of it
    cut_steps                                     that were done in pieces, because in one they were not solved
    gaining_pieces                                the smallest ones, that gained energy all the same
    unsolved                                      replicas that stand still because a step of theirs was not solved
    fewest_steps                                  solved by the replica that solved fewest, since the last report
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
        """Count another report in."""
        self.steps += other.steps
        self.newton_iterations += other.newton_iterations
        self.linear_iterations += other.linear_iterations
        self.most_newton_iterations = max(self.most_newton_iterations, other.most_newton_iterations)
        self.cut_steps += other.cut_steps
        self.gaining_pieces += other.gaining_pieces
        self.unsolved += other.unsolved
