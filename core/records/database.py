"""The clinic database: how a connection is opened, and one session per call."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.orm import Session

from core.records.failures import told_to_the_user

BUSY_TIMEOUT_S = 15.0
"""How long a write waits for another thread or program before it gives up."""

EngineFactory = Callable[[Path], Engine]
"""Makes the engine for a database file. An encrypted database is another factory."""


def plain_engine(path: Path) -> Engine:
    """Engine on an unencrypted SQLite file: foreign keys, write-ahead log, full sync, waiting for locks.

    Values never appear in errors or logs (``hide_parameters``): they are patient data.
    """
    engine = create_engine(
        f"sqlite:///{path}",
        hide_parameters=True,
        connect_args={"timeout": BUSY_TIMEOUT_S, "check_same_thread": False},
    )
    event.listen(engine, "connect", _prepare_connection)
    event.listen(engine, "begin", _begin)
    return engine


def _prepare_connection(connection: sqlite3.Connection, _record: Any) -> None:
    connection.isolation_level = None  # transactions begin in `_begin`, never behind our back
    cursor = connection.cursor()
    try:
        for pragma in ("foreign_keys=ON", "journal_mode=WAL", "synchronous=FULL", "trusted_schema=OFF"):
            cursor.execute(f"PRAGMA {pragma}")
    finally:
        cursor.close()


def _begin(connection: Connection) -> None:
    writes = connection.get_execution_options().get("geoderm_writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


class Database:
    """Sessions on one clinic database. Safe to use from several threads: every call has its own session."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._writer = engine.execution_options(geoderm_writes=True)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session that sees one consistent state."""
        with told_to_the_user(), Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session that holds the write lock from its beginning and commits whole or not at all."""
        with (
            told_to_the_user(),
            Session(self._writer, expire_on_commit=False) as session,
            session.begin(),
        ):
            yield session

    @contextmanager
    def write_connection(self) -> Iterator[Connection]:
        """A bare connection inside a write transaction, for migrations."""
        with told_to_the_user(), self._writer.begin() as connection:
            yield connection

    def dispose(self) -> None:
        """Close every connection."""
        self.engine.dispose()
