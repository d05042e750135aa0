"""Reading and checking scenes."""
