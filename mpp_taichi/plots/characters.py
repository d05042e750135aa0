"""Characters of Unicode: which of them belong together, which way they are written, and which fonts have them."""

import sys
import unicodedata

SKIN_TONES = range(0x1F3FB, 0x1F400)
SELECTORS = range(0xFE00, 0xFE10)  # they choose between two forms of the character before them
JOINER = "\u200d"
EASTERN = ("CJK", "HIRAGANA", "KATAKANA", "HANGUL", "BOPOMOFO", "FULLWIDTH", "HALFWIDTH", "IDEOGRAPHIC", "KANGXI")
PICTURES = range(0x1F000, 0x1FB00)
# Packages of Debian and Ubuntu, and in brackets of Fedora.
EASTERN_FONT = "fonts-noto-cjk", "google-noto-sans-cjk-fonts"
PICTURE_FONT = "fonts-noto-color-emoji", "google-noto-color-emoji-fonts"
OTHER_FONT = "fonts-noto-core", "google-noto-sans-fonts"
PRIVATE = "Co"


def shown(text: str) -> str:
    """The text with letters and their accents as one character, where Unicode has that character."""
    return unicodedata.normalize("NFC", text)


def clusters(text: str) -> list[str]:
    """The text in letters with their marks, which one font must draw."""
    found: list[str] = []
    for character in text:
        if found and (_is_mark(character) or found[-1].endswith(JOINER)):
            found[-1] += character
        else:
            found.append(character)
    return found


def needed(text: str) -> str:
    """The characters that a font must have: all that are more than an instruction for the characters beside them."""
    return "".join(each for each in text if unicodedata.category(each) not in ("Cc", "Cf") and ord(each) not in SELECTORS)


def written_from_the_right(text: str) -> bool:
    """Whether a text has letters of a script that is written from right to left."""
    return not text.isascii() and any(unicodedata.bidirectional(each) in ("R", "AL") for each in text)


def script_of(cluster: str) -> str:
    """The first word of a character's name in Unicode, which names its script or, of a symbol, nearly the symbol itself."""
    code = ord(cluster[0])
    if code in PICTURES:
        return "PICTURES"
    name = unicodedata.name(cluster[0], "")
    if name.startswith(EASTERN):
        return EASTERN[0]
    return name.partition(" ")[0] or unicodedata.category(cluster[0])


def package_with(cluster: str) -> str:
    """Where a font with a character is to be had, in a few words."""
    if unicodedata.category(cluster[0]) == PRIVATE:
        return "Unicode leaves characters of the private use area to the makers of fonts"
    script = script_of(cluster)
    package, fedora = PICTURE_FONT if script == "PICTURES" else EASTERN_FONT if script == EASTERN[0] else OTHER_FONT
    if sys.platform.startswith("linux"):
        return f"the package {package} has them (Fedora: {fedora})"
    return f"a font of Noto has them (fonts.google.com/noto; on Debian the package {package})"


def _is_mark(character: str) -> bool:
    """Whether a character changes the character before it, and has no place of its own."""
    return unicodedata.category(character) in ("Mn", "Me", "Mc", "Cf") or ord(character) in SKIN_TONES
