"""Text as it is searched: no accents, no case, no punctuation."""

from __future__ import annotations

import unicodedata

from core.errors import InputError

_LETTERS = str.maketrans(
    {"ł": "l", "ø": "o", "đ": "d", "ð": "d", "þ": "th", "æ": "ae", "œ": "oe", "ı": "i", "ħ": "h", "ŧ": "t"}
)
_SILENT = {"'", "’", "ʼ", "`", "´", "ʹ"}


def search_form(text: str) -> str:
    """Text without accents, case and punctuation: ``"Nguyễn-O'Brien"`` gives ``"nguyen obrien"``."""
    plain = text
    for _ in range(2):  # folding case makes new letters to decompose, and the other way round
        plain = unicodedata.normalize("NFKD", plain).casefold()
    plain = "".join(c for c in unicodedata.normalize("NFKD", plain) if not unicodedata.combining(c))
    plain = "".join(c for c in plain.translate(_LETTERS) if c not in _SILENT)
    return " ".join("".join(c if c.isalnum() else " " for c in plain).split())


def patient_search_key(family_name: str, given_name: str, clinic_number: str) -> str:
    """What the patient list is searched and sorted by. Every word begins after a space."""
    number = search_form(clinic_number)
    words = [search_form(family_name), search_form(given_name), number]
    if " " in number:
        words.append(number.replace(" ", ""))
    return " " + " ".join(word for word in words if word)


def clean_line(text: str, field: str, *, longest: int, required: bool = False) -> str:
    """One line of typed text: composed characters, single spaces, checked length.

    Raises
    ------
    InputError
        If a required field is empty or the text is too long. The text itself is not repeated.
    """
    line = " ".join(unicodedata.normalize("NFC", text).split())
    if required and not line:
        raise InputError(f"The {field} is empty.", f"Type the {field}.")
    if len(line) > longest:
        raise InputError(f"The {field} is longer than {longest} characters.", "Shorten it.")
    return line


def clean_note(text: str, *, longest: int = 20_000) -> str:
    """A note of several lines: composed characters, no control characters, checked length."""
    note = unicodedata.normalize("NFC", text).replace("\r\n", "\n").replace("\r", "\n")
    note = "".join(c for c in note if c in "\n\t" or unicodedata.category(c) != "Cc").strip()
    if len(note) > longest:
        raise InputError(f"The note is longer than {longest} characters.", "Shorten it.")
    return note
