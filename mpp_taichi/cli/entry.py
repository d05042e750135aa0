"""The entry point of the command line: it imports the program, and names the missing package where an import fails."""

import sys

from mpp_taichi.cli._terminal import prepare_streams, put_failure, say
from mpp_taichi.errors import MissingPackageError
from mpp_taichi.missing_package import missing_packages_named


def main() -> int:
    """Run the command line and return its exit code."""
    try:
        with missing_packages_named():
            from mpp_taichi.cli.main import main as run
    except MissingPackageError as error:
        prepare_streams()
        say(str(error))
        return put_failure(str(error), [str(error)], error.exit_code) if "--json" in sys.argv[1:] else error.exit_code
    return run()
