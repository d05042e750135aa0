"""Launchers: by which launchers of `step/` a family of methods is run. Host side; no Taichi."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Launchers:
    """The data of a family of methods that only `step/choose.py` reads.

    serial, replicas, parallel   the file of `step/` whose launcher runs the family under that plan; empty: there is no such
                                 plan. Where only `parallel` is set, it stands for the three launchers of methods of stages
    quickly    the kernels are long, and are compiled without Taichi's own optimisation (see quick_compilation.py)
    vectors    the step reads and writes vectors by components, so that it can be compiled together with the sum over pairs in
               explicit vectors (see explicit_vectors.py)
    cpu_only   other backends lack something that the step needs, as integers of 64 bits
    copies_elsewhere   other backends run several copies, a thread for each copy, where they compute in f64; one copy by itself
                       would be one thread of a GPU
    """

    serial: str = "serial"
    replicas: str = "replicas"
    parallel: str = "parallel"
    quickly: bool = False
    vectors: bool = False
    cpu_only: bool = False
    copies_elsewhere: bool = False
