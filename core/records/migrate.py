"""Brings a clinic database to the schema of this version, and refuses one that is newer."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy import Connection

from core.errors import WorkError
from core.records.database import Database
from core.records.failures import database_error, told_to_the_user

SCHEMA_HEAD = "0001"
"""The revision this version of the application works with (the last one in ``migrations/versions``)."""

MIGRATIONS = Path(__file__).resolve().parent / "migrations"


def prepare_database(database: Database, path: Path) -> None:
    """Create or upgrade the database at ``path`` to `SCHEMA_HEAD`.

    An older database is copied beside itself before it is upgraded; the upgrade is one transaction.

    Raises
    ------
    WorkError
        If the database was written by a newer version, or is not a GeoDerm clinic.
    """
    with told_to_the_user(), database.engine.connect() as connection:
        revision = _revision(connection)
    if revision == SCHEMA_HEAD:
        return
    if revision is not None:
        _refuse_unknown(revision)
        _copy_before_upgrade(path, revision)
    with database.write_connection() as connection:
        if _revision(connection) != SCHEMA_HEAD:  # another program may have been faster
            _upgrade(connection)


def _revision(connection: Connection) -> str | None:
    """Revision of the database, None if it is empty."""
    names = {
        row[0] for row in connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type='table'")
    }
    if "alembic_version" not in names:
        if names:
            raise WorkError(
                "The file clinic.db in this folder is not a GeoDerm clinic.", "Choose another folder."
            )
        return None
    row = connection.exec_driver_sql("SELECT version_num FROM alembic_version").first()
    return None if row is None else str(row[0])


def _refuse_unknown(revision: str) -> None:
    from alembic.script import ScriptDirectory

    known = {script.revision for script in ScriptDirectory(str(MIGRATIONS)).walk_revisions()}
    if revision not in known:
        raise WorkError(
            "This clinic folder was written by a newer version of GeoDerm.",
            "Install the newer version on this computer; the records were not touched.",
        )


def _copy_before_upgrade(path: Path, revision: str) -> None:
    copy = path.with_name(f"{path.stem}.before-upgrade-from-{revision}{path.suffix}")
    try:
        with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(copy)) as target:
            source.backup(target)
    except sqlite3.Error as error:
        told = database_error(error)
        if told is None:
            raise
        raise told from None


def _upgrade(connection: Connection) -> None:
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    command.upgrade(config, "head")
