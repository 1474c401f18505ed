"""Tokens in files."""

import pytest

from shipshape.errors import FileError
from shipshape.token_file import read_token


def test_the_token_is_read_without_the_line_end(tmp_path):
    (tmp_path / "token").write_text(" abc\r\n")
    assert read_token(tmp_path / "token") == "abc"


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match=r"^expected to read a token from none, got: No such file or directory$"):
        read_token(tmp_path / "none")


def test_bytes_that_are_no_token(tmp_path):
    (tmp_path / "token").write_bytes(b"\xff\xfe")
    with pytest.raises(FileError, match=r"^expected a token in token, got bytes that are none$"):
        read_token(tmp_path / "token")
