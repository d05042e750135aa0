"""The renderers of pictures without a window, by the names that a user gives them."""

RENDERERS = ("own", "ggui")
OWN_RENDERER, GGUI = RENDERERS


def needs_ggui(renderer: str) -> bool:
    """Whether a renderer needs a driver of Vulkan that GGUI works with."""
    return renderer == GGUI
