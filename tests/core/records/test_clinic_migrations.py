from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from core.errors import WorkError
from core.records import ClinicStore
from core.records.database import plain_engine
from core.records.migrate import MIGRATIONS, SCHEMA_HEAD
from core.records.models import Base


def test_a_new_folder_gets_exactly_the_schema_of_the_models(tmp_path: Path) -> None:
    ClinicStore.open(tmp_path).close()
    engine = plain_engine(tmp_path / "clinic.db")
    with engine.connect() as connection:
        context = MigrationContext.configure(
            connection, opts={"compare_type": True, "compare_server_default": True}
        )
        assert compare_metadata(context, Base.metadata) == []
        checks = {
            row[0]: row[1].count("CHECK")
            for row in connection.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE type='table'")
        }
    engine.dispose()
    # alembic does not compare checks: the tables that restrict a column must still do so
    assert {name: checks[name] for name in ("patients", "captures", "lesions", "observations")} == {
        "patients": 1,
        "captures": 1,
        "lesions": 2,
        "observations": 2,
    }


def test_the_version_the_code_expects_is_the_last_migration() -> None:
    assert ScriptDirectory(str(MIGRATIONS)).get_current_head() == SCHEMA_HEAD


def test_opening_again_changes_nothing(tmp_path: Path) -> None:
    with ClinicStore.open(tmp_path) as store:
        user = store.users.create("a", "A", "password")
    with ClinicStore.open(tmp_path) as store:
        assert store.users.list() == [user]


def test_a_newer_schema_is_refused_and_left_alone(tmp_path: Path) -> None:
    ClinicStore.open(tmp_path).close()
    with closing(sqlite3.connect(tmp_path / "clinic.db")) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(WorkError, match="newer version of GeoDerm"):
        ClinicStore.open(tmp_path)
    with closing(sqlite3.connect(tmp_path / "clinic.db")) as connection:
        assert connection.execute("SELECT version_num FROM alembic_version").fetchone() == ("9999",)


def test_another_program_s_database_is_refused(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "clinic.db")) as connection:
        connection.execute("CREATE TABLE recipes (id INTEGER)")
    with pytest.raises(WorkError, match="not a GeoDerm clinic"):
        ClinicStore.open(tmp_path)


def test_a_file_that_is_no_database_is_called_damaged(tmp_path: Path) -> None:
    (tmp_path / "clinic.db").write_bytes(b"not a database at all" * 100)
    with pytest.raises(WorkError, match="database is damaged"):
        ClinicStore.open(tmp_path)


def test_an_interrupted_first_migration_leaves_an_empty_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from alembic import op

    def power_cut(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(op, "create_index", power_cut)
        with pytest.raises(KeyboardInterrupt):
            ClinicStore.open(tmp_path)
    with closing(sqlite3.connect(tmp_path / "clinic.db")) as connection:
        assert connection.execute("SELECT count(*) FROM sqlite_master WHERE type='table'").fetchone() == (0,)
    ClinicStore.open(tmp_path).close()
