"""The attributes of a Simulation for other parts of the program; `dir`, and so the completion of a shell, leaves them out."""

INNER_NAMES = (
    *("begin_phase", "contacts", "course", "integrator", "judge", "launcher", "mark", "parameter_change", "phase_energy"),
    *("return_to", "sample_at_multiples_of", "snapshot_ahead", "state", "total_force", "try_steps", "when_phase_begins"),
)
