"""Forces, one per file."""
