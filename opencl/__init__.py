"""The program's models in OpenCL, by hand, for comparison. `mpp_taichi.compare.opencl_package` alone loads it."""
