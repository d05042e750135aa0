"""Assemble the bitcode of LLVM that the package keeps beside its sources, where a source has changed.

    apt-get install clang-15
    python tools/make/assemble_bitcode.py

Taichi 1.7 holds LLVM 15 and reads pointers that have a type, so LLVM 14 or 15 has to write them, and no later one.
"""

import argparse
import hashlib
import re
import subprocess
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "mpp_taichi" / "device" / "fast_taichi"
SOURCES = {  # and how they are compiled; LLVM's own language is only assembled
    FOLDER / "lane_arithmetic.ll": ("-Xclang", "-disable-llvm-passes"),
    FOLDER / "prefetch.ll": ("-Xclang", "-disable-llvm-passes"),
    FOLDER / "spring_lanes.c": ("-O2", "-Wall", "-Wextra", "-Werror", "-ffreestanding", "-mavx512f"),
    FOLDER / "worker_threads.c": ("-O2", "-Wall", "-Wextra", "-Werror", "-ffreestanding"),
    **dict.fromkeys(sorted(FOLDER.glob("series_f*.c")), ("-O2", "-Wall", "-Wextra", "-Werror", "-ffreestanding", "-mavx512f")),
}
CLANG = ("clang-15", "--target=x86_64-pc-linux-gnu", "-Xclang", "-no-opaque-pointers", "-emit-llvm", "-c")


def target(source):
    """Where the bitcode of a source belongs: the name has a digest of the source."""
    return source.with_name(f"{source.stem}_{hashlib.sha256(text(source)).hexdigest()[:8]}.bc")


def text(source):
    """A source, and after it the files beside it that it includes."""
    own = source.read_bytes()
    names = re.findall(rb'^#include "(.*)"$', own, re.MULTILINE)
    return b"".join([own, *(source.with_name(name.decode()).read_bytes() for name in names)])


def main():
    """Write each file that is not there, in place of the file before."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for source, options in SOURCES.items():
        if target(source).exists():
            continue
        for old in source.parent.glob(f"{source.stem}_*.bc"):
            old.unlink()
        subprocess.run([*CLANG, *options, source.name, "-o", target(source).name], cwd=source.parent, check=True)
        print(target(source).name)


if __name__ == "__main__":
    main()
