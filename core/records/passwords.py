"""Passwords, kept as Argon2id hashes."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from core.errors import InputError

if TYPE_CHECKING:
    from argon2 import PasswordHasher

SHORTEST = 8
"""Shortest password accepted (NIST SP 800-63B, section 5.1.1.2)."""


@lru_cache(maxsize=1)
def _hasher() -> PasswordHasher:
    from argon2 import PasswordHasher

    return PasswordHasher()


def hash_password(password: str) -> str:
    """Argon2id hash of a password, with its own salt and parameters.

    Raises
    ------
    InputError
        If the password is shorter than `SHORTEST` characters.
    """
    if len(password) < SHORTEST:
        raise InputError(f"The password is shorter than {SHORTEST} characters.", "Choose a longer one.")
    return _hasher().hash(password)


def password_matches(stored_hash: str, password: str) -> bool:
    """Whether the password belongs to the hash."""
    from argon2.exceptions import InvalidHashError, VerificationError

    try:
        return _hasher().verify(stored_hash, password)
    except (VerificationError, InvalidHashError):
        return False


def needs_new_hash(stored_hash: str) -> bool:
    """Whether the hash was made with weaker parameters than today's."""
    return _hasher().check_needs_rehash(stored_hash)


@lru_cache(maxsize=1)
def _nobody() -> str:
    return _hasher().hash("a password that nobody has")


def waste_a_verification(password: str) -> None:
    """Spend the time of a verification, so that an unknown user name answers no faster."""
    password_matches(_nobody(), password)
