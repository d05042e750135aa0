"""Stability: the largest step that the springs of a scene allow its integrator, known before it is taken.

Pure NumPy. `network` linearises the scene where it is placed, `spectrum` finds its largest frequency, `step_limit` the
largest stable step of an integrator on this oscillation, `advice` words the warning or the refusal.
"""

from mpp_taichi.stability.advice import StepAdvice, advise, check_step
from mpp_taichi.stability.guard import StepGuard

__all__ = ["StepAdvice", "StepGuard", "advise", "check_step"]
