"""`python -m mpp_taichi SCENE` is the command line."""

import sys

from mpp_taichi.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
