"""One step: the kernels around it, and the plans that they run under."""
