"""The manifest: what is accepted, and what is told before hours of work begin."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from app.batch.case import Case
from app.batch.manifest import read_manifest
from core.errors import InputError

HEAD = "case,first,followup,lesions\n"


def read(path: Path, content: str | bytes) -> list[Case]:
    path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    return read_manifest(path, method="trilateration", appearance=True, seed=7)


def test_paths_are_seen_from_the_manifest_and_options_hold_for_silent_rows(tmp_path: Path) -> None:
    one, two = read(
        tmp_path / "m.csv",
        "case,first,followup,lesions,method,seed\np1,a,../b,l.json,,\np2,/x/a,b,l.json,voting-fmm,3\n",
    )
    assert one == Case(
        "p1", str(tmp_path / "a"), str(tmp_path / "../b"), str(tmp_path / "l.json"), "trilateration", True, 7
    )
    assert (two.first, two.method, two.seed) == ("/x/a", "voting-fmm", 3)


def test_what_spreadsheets_write_is_read(tmp_path: Path) -> None:
    (case,) = read(
        tmp_path / "m.csv", b'\xef\xbb\xbfCase, First ,followup,lesions,age\r\n"p, 1",a,b,l,63\r\n\r\n'
    )
    assert (case.name, case.first) == ("p, 1", str(tmp_path / "a"))


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (HEAD, "holds no pair"),
        ("case;first;followup;lesions\np;a;b;l\n", "separated by semicolons"),
        ("case\tfirst\tfollowup\tlesions\np\ta\tb\tl\n", "separated by tabs"),
        ("case,first,lesions\np,a,l\n", 'column "followup" is missing'),
        ("case,first,followup,lesions,first\np,a,b,l,c\n", 'column "first" occurs twice'),
        ("case,first,followup,lesions,sed\np,a,b,l,3\n", 'Is "seed" meant?'),
        (HEAD + "p,a,b\n", "line 2 has 3 fields"),
        (HEAD + "p,a,b,l\np2,a,b,l,x\n", "line 3 has 5 fields"),
        (HEAD + "p,,b,l\n", 'line 2, column "first": is empty'),
        (HEAD + ",a,b,l\n", 'line 2, column "case": is empty'),
        (HEAD + "p,a,b,l\n\nP,a,b,l\n", 'line 4, column "case": "P" is already the case of line 2'),
        ("case,first,followup,lesions,seed\np,a,b,l,-1\n", 'column "seed": "-1" is not a whole number'),
        ("case,first,followup,lesions,seed\np,a,b,l,1.5\n", 'column "seed"'),
        ("case,first,followup,lesions,method\np,a,b,l,best\n", 'column "method": there is no method "best"'),
        (HEAD + 'p,"a,b,l\n', "is not CSV"),
        ("case,first,followup,lesions\n".encode("utf-16"), "is not a text file in UTF-8"),
        (HEAD.encode() + b"p\xff,a,b,l\n", "line 2 is not UTF-8"),
        (HEAD + "p,a\0,b,l\n", "is not a text file"),
    ],
)
def test_a_wrong_manifest_is_told_with_line_and_column(
    tmp_path: Path, content: str | bytes, told: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m.csv", content)
    assert told in str(caught.value)
    assert str(tmp_path / "m.csv") in str(caught.value)


@pytest.mark.parametrize(
    "name",
    ["..", ".", "../p", "a/b", "a\\b", "c:p", "con", "LPT1.x", ".hidden", "p.", "a\tb", "p*", "x" * 201],
)
def test_a_case_that_is_no_safe_file_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match='line 2, column "case"'):
        read(tmp_path / "m.csv", f'{HEAD}"{name}",a,b,l\n')


def test_names_of_any_language_are_safe(tmp_path: Path) -> None:
    (case,) = read(tmp_path / "m.csv", HEAD + "Пациент № 7 (левая),a,b,l\n")
    assert case.name == "Пациент № 7 (левая)"


def test_a_missing_manifest_or_a_folder_is_told(tmp_path: Path) -> None:
    for path in (tmp_path / "no.csv", tmp_path):
        with pytest.raises(InputError, match="is not a file"):
            read_manifest(path, method="trilateration", appearance=True, seed=0)


def test_ten_thousand_rows_are_read_in_a_moment(tmp_path: Path) -> None:
    start = time.process_time()
    cases = read(tmp_path / "m.csv", HEAD + "".join(f"p{i},a/{i},b/{i},l\n" for i in range(10_000)))
    assert len(cases) == 10_000
    assert time.process_time() - start < 3
