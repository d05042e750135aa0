"""Equations of a page, from TeX to MathML, which browsers typeset without a script."""

import html as entities
import re

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.S)
_DISPLAYED = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.S)


def as_mathml(html: str) -> str:
    """The page with MathML in place of the TeX that the extension arithmatex has marked."""
    html = _DISPLAYED.sub(lambda found: f"<div>{_mathml(found[1], 'block')}</div>", html)
    return _INLINE.sub(lambda found: _mathml(found[1], "inline"), html)


def _mathml(tex: str, display: str) -> str:
    return str(convert(entities.unescape(tex).strip(), display=display))
