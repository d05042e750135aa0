"""Worksheets of the course: predictions that a pupil writes down, and that a run of a scene confirms or refutes."""
