"""``python -m app`` is the ``geoderm`` command."""

from app.cli.main import run

if __name__ == "__main__":
    run()
