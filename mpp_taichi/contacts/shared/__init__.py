"""What several contact solvers use."""
