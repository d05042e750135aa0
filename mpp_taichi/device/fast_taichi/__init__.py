"""What goes around Taichi to make it faster."""
