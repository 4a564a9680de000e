"""Every accepted format is known from the first picture on, in a fresh process."""

from __future__ import annotations

import subprocess
import sys

import pytest

CODE = """
import io, sys
from core.records.images import check_image
data = sys.stdin.buffer.read()
print(check_image(data).width)
"""


@pytest.mark.parametrize("name", ["JPEG", "PNG", "TIFF"])
def test_the_first_picture_of_a_process_may_be_of_any_accepted_format(name: str) -> None:
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.new("RGB", (31, 20), (200, 150, 130)).save(buffer, name)
    run = subprocess.run(
        [sys.executable, "-c", CODE], input=buffer.getvalue(), capture_output=True, check=True
    )
    assert run.stdout.strip() == b"31"
