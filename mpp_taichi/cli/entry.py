"""The entry point of the command line: it imports the program, and says why an import fails: a package or memory is missing.

Imports take most of a second, so they are made in `main`, where SIGINT is answered by a line.
"""

import os
import signal
import sys
from types import FrameType


def main() -> int:
    """Run the command line and return its exit code."""
    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # and is not ignored, as in a job with `&`
    if listens:
        signal.signal(signal.SIGINT, _leave)
    from mpp_taichi.cli._terminal import prepare_streams, put_failure, say
    from mpp_taichi.device.memory_limit import require_least
    from mpp_taichi.device.thread_count import bound_threads_of_numpy
    from mpp_taichi.device.with_parent import end_with_parent
    from mpp_taichi.errors import CapacityError, MissingPackageError
    from mpp_taichi.missing_package import missing_packages_named

    try:
        end_with_parent()
        require_least()
        bound_threads_of_numpy()
        with missing_packages_named():
            from mpp_taichi.cli.main import main as run
    except (CapacityError, MissingPackageError) as error:
        prepare_streams()
        say(str(error))
        return put_failure(str(error), [str(error)], error.exit_code) if "--json" in sys.argv[1:] else error.exit_code
    finally:
        if listens:
            signal.signal(signal.SIGINT, signal.default_int_handler)
    return run()


def _leave(number: int, frame: FrameType | None) -> None:
    """End at once: nothing has begun that would have to be ended well."""
    os.write(2, b"interrupted by SIGINT\n")
    os._exit(128 + number)
