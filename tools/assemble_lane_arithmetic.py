"""Assemble mpp_taichi/neighbors/lane_arithmetic.ll into the bitcode beside it, which is kept with the sources.

    pip install llvmlite==0.43.0
    python tools/assemble_lane_arithmetic.py

Taichi 1.7 holds LLVM 15 and reads pointers that have a type: bitcode of LLVM 14, as that llvmlite writes it, is what it knows.
"""

import hashlib
from pathlib import Path

import llvmlite.binding as llvm

FOLDER = Path(__file__).parents[1] / "mpp_taichi" / "neighbors"


def main():
    """Write the file, named after a digest of its source, in place of the one before."""
    if llvm.llvm_version_info[0] != 14:
        raise SystemExit("this wants LLVM 14: pip install llvmlite==0.43.0")
    source = (FOLDER / "lane_arithmetic.ll").read_text(encoding="ascii")
    module = llvm.parse_assembly(source)
    module.verify()
    for old in FOLDER.glob("lane_arithmetic_*.bc"):
        old.unlink()
    target = FOLDER / f"lane_arithmetic_{hashlib.sha256(source.encode()).hexdigest()[:8]}.bc"
    target.write_bytes(module.as_bitcode())
    print(target.name)


if __name__ == "__main__":
    main()
