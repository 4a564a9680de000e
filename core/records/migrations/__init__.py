"""Alembic environment of the clinic database."""
