"""The kernels around one step, and the plans by which they run."""
