"""The check that quantities and diagnostics of contacts share."""

from mpp_taichi.quantities._base import NoResultError
from mpp_taichi.scene.spec import SceneSpec


def require_contacts(spec: SceneSpec) -> None:
    """NoResultError where the scene has no contacts."""
    if spec.contacts is None:
        raise NoResultError("the scene has no contacts")
