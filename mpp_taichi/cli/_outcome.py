"""Outcome: the end of a run of the command line, as a JSON object and as the closing summary."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._terminal import CLOSED_OUTPUT_CODE, ClosedOutputError, put, put_json, say
from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.report.expectations import Verdict
from mpp_taichi.report.summary_lines import lines

if TYPE_CHECKING:
    from mpp_taichi.cli._interactive import Stage


@dataclass(eq=False)
class Outcome:
    """The end of a run."""

    summary: dict[str, Any]
    exit_code: int
    error: MppError | None = None
    verdicts: list[Verdict] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    next: "Stage | None" = None
    """The simulation and window for another scene that was opened in the window; None at an ordinary end."""

    def as_json(self) -> dict[str, Any]:
        """The JSON object of `--json`."""
        expected = [{**vars(verdict), "label": verdict.label} for verdict in self.verdicts]
        trouble: dict[str, Any] = {"error": str(self.error)} if self.error else {}
        if isinstance(self.error, StabilityError):
            trouble["broke_at"] = {key: getattr(self.error, key) for key in ("step", "time", "particle")}
        return {**self.summary, "expect": expected, "files": self.files, **trouble, "exit_code": self.exit_code}

    def lines(self, *, verbose: bool = False) -> list[str]:
        """The closing summary for a person."""
        return lines(self.summary, files=self.files, verdicts=self.verdicts, error=self.error, verbose=verbose)


def report(outcome: Outcome, arguments: argparse.Namespace, *, before: Sequence[Outcome] = ()) -> int:
    """Print the summary of a run on standard output, or with --json the object there and the summary on standard error.

    `before` are the runs of scenes that were open in the window before. Returns the exit code, of the first run that has one;
    only a run that went well can end with the code of an output that its reader has closed.
    """
    code = next((each.exit_code for each in (*before, outcome) if each.exit_code), 0)
    try:
        if not arguments.quiet:
            tell(outcome, arguments)
        if arguments.json:
            earlier = {"scenes_before": [each.as_json() for each in before]} if before else {}
            put_json(outcome.as_json() | earlier)
    except ClosedOutputError:
        return code or CLOSED_OUTPUT_CODE
    return code


def tell(outcome: Outcome, arguments: argparse.Namespace) -> None:
    """Print the summary alone, on the stream that holds results for a person."""
    text = "\n".join(outcome.lines(verbose=arguments.verbose))
    say(text, verdicts=True) if arguments.json else put(text, verdicts=True)
