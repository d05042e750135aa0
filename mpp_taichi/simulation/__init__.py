"""A run: phases of a scene on a device, their clock, and the way back."""
