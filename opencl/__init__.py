"""The program's models in OpenCL, by hand, for comparison. Loaded by `mpp_taichi.opencl_package`, and by nothing else."""
