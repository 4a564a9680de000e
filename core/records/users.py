"""The people who may sign in."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import func, select

from core.errors import InputError
from core.records.database import Database
from core.records.failures import missing
from core.records.models import UserRow
from core.records.passwords import hash_password, needs_new_hash, password_matches, waste_a_verification
from core.records.records import User
from core.records.text import clean_line


def _user(row: UserRow) -> User:
    return User(row.id, row.username, row.display_name, row.created_at)


class Users:
    """Users of one clinic."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def create(self, username: str, display_name: str, password: str) -> User:
        """Add a user. The user name is kept in lower case and is unique.

        Raises
        ------
        InputError
            If the name is empty or taken, or the password too short.
        """
        username = clean_line(username, "user name", longest=64, required=True).casefold()
        display_name = clean_line(display_name, "name", longest=200) or username
        password_hash = hash_password(password)
        with self._db.write() as session:
            if session.scalar(select(UserRow.id).where(UserRow.username == username)) is not None:
                raise InputError("This user name is taken.", "Choose another user name.")
            row = UserRow(
                username=username,
                display_name=display_name,
                password_hash=password_hash,
                created_at=datetime.now(UTC),
            )
            session.add(row)
            session.flush()
            return _user(row)

    def authenticate(self, username: str, password: str) -> User | None:
        """The user if name and password fit, otherwise None (in the same time for an unknown name)."""
        username = " ".join(username.split()).casefold()
        with self._db.read() as session:
            row = session.scalar(select(UserRow).where(UserRow.username == username))
        if row is None:
            waste_a_verification(password)
            return None
        if not password_matches(row.password_hash, password):
            return None
        if needs_new_hash(row.password_hash):
            self._set_hash(row.id, hash_password(password))
        return _user(row)

    def set_password(self, user_id: int, password: str) -> None:
        """Give a user another password."""
        self._set_hash(user_id, hash_password(password))

    def _set_hash(self, user_id: int, password_hash: str) -> None:
        with self._db.write() as session:
            row = session.get(UserRow, user_id)
            if row is None:
                raise missing("user")
            row.password_hash = password_hash

    def get(self, user_id: int) -> User:
        """One user."""
        with self._db.read() as session:
            row = session.get(UserRow, user_id)
        if row is None:
            raise missing("user")
        return _user(row)

    def list(self) -> list[User]:
        """All users, by user name."""
        with self._db.read() as session:
            return [_user(row) for row in session.scalars(select(UserRow).order_by(UserRow.username))]

    def count(self) -> int:
        """How many users there are."""
        with self._db.read() as session:
            return session.scalar(select(func.count()).select_from(UserRow)) or 0
