"""Settings of the whole clinic, kept with its records."""

from __future__ import annotations

from core.records.database import Database
from core.records.models import SettingRow
from core.records.text import clean_line


class Settings:
    """Named texts, for example ``clinic_name`` (printed on reports)."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def get(self, key: str, default: str = "") -> str:
        """A setting, or ``default`` if it was never set."""
        with self._db.read() as session:
            row = session.get(SettingRow, key)
        return default if row is None else row.value

    def set(self, key: str, value: str) -> None:
        """Set or replace a setting."""
        key = clean_line(key, "setting name", longest=64, required=True)
        with self._db.write() as session:
            session.merge(SettingRow(key=key, value=value))
