import hashlib
import logging
import os
import re
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.cli import main
from shipshape.errors import SettingsError
from shipshape.serving.reloading import LOOK_S
from shipshape.serving.tokens import Tokens, check_name, fresh_token, hash_of, parse_tokens

NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", fullmatch=True)
TOKENS = st.text(string.ascii_letters + string.digits + "-_", min_size=1, max_size=60)
GAPS = st.text(" \t", min_size=1, max_size=4)
NOISE = st.sampled_from(["", "   ", "# a comment", "  # fleet 00ff", "\t#"])


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "tokens"


def line(name, token):
    return f"{name} {hash_of(token)}\n"


def write(path, text):
    """Replace the file as an operator should: at once."""
    fresh = path.with_suffix(".new")
    fresh.write_text(text, encoding="utf-8")
    os.replace(fresh, path)


def test_the_hash_is_that_of_other_tools():
    assert hash_of("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert hash_of("abc") == hashlib.sha256(b"abc").hexdigest()


def test_tokens_are_long_and_differ():
    tokens = {fresh_token() for _ in range(100)}
    assert len(tokens) == 100
    assert {len(token) for token in tokens} == {43}, "32 bytes in base64url"


@given(
    holders=st.dictionaries(TOKENS, NAMES, max_size=6), gap=GAPS, noise=st.lists(NOISE, max_size=4), data=st.data()
)
def test_what_is_written_is_read(holders, gap, noise, data):
    lines = [f"{name}{gap}{hash_of(token)}{data.draw(NOISE)}" for token, name in holders.items()]
    text = "\n".join(data.draw(st.permutations(lines + noise)))
    assert dict(parse_tokens(text, "tokens")) == {hash_of(token): name for token, name in holders.items()}


@given(text=st.text(max_size=64))
def test_any_other_text_is_refused_without_being_quoted(text):
    lines = [line for line in text.splitlines() if line.partition("#")[0].split()]
    if not lines:
        assert parse_tokens(text, "the file") == ()
        return
    with pytest.raises(SettingsError) as caught:  # no text of up to 64 letters holds a hash
        parse_tokens(text, "the file")
    assert re.fullmatch(r"expected NAME SHA256HEX in line \d+ of the file, got something else", str(caught.value))


@pytest.mark.parametrize(
    "bad",
    [
        "fleet",
        "fleet 00ff",
        f"fleet {'0' * 63}",
        f"fleet {'0' * 65}",
        f"fleet {'g' * 64}",
        f"fleet {'0' * 64} more",
        f"-fleet {'0' * 64}",
        f"{'f' * 65} {'0' * 64}",
        f"fleét {'0' * 64}",
        "my-secret-token",
    ],
)
def test_a_bad_line_is_named_by_its_number_alone(bad):
    with pytest.raises(SettingsError) as caught:
        parse_tokens(f"# one\n{bad}\n", "tokens")
    assert str(caught.value) == "expected NAME SHA256HEX in line 2 of tokens, got something else"


def test_one_token_cannot_be_two_clients():
    with pytest.raises(
        SettingsError, match=r"^expected one name a token in tokens, got line 2 with that of shore$"
    ):
        parse_tokens(line("shore", "t") + line("fleet", "t"), "tokens")


def test_a_name_may_have_two_tokens_while_one_follows_the_other(path):
    write(path, line("fleet", "old") + line("fleet", "new"))
    tokens = Tokens(path)
    assert tokens.name_of("old") == tokens.name_of("new") == "fleet"


@pytest.mark.parametrize("presented", ["", "t ", "T", "token", "\xff", "x" * 10_000, hash_of("t")])
def test_what_is_not_the_token_is_nobodys(path, presented):
    write(path, line("fleet", "t"))
    tokens = Tokens(path)
    assert tokens.name_of("t") == "fleet"
    assert tokens.name_of(presented) is None


def test_a_token_is_revoked_within_a_second(path, clock):
    write(path, line("fleet", "a") + line("shore", "b"))
    tokens = Tokens(path, clock)
    write(path, line("shore", "b"))
    assert tokens.name_of("a") == "fleet", "it is not looked at more often than that"
    clock.now += LOOK_S
    assert tokens.name_of("a") is None
    assert tokens.name_of("b") == "shore"


def test_nobody_is_left_when_the_last_line_is_taken_out(path, clock):
    write(path, line("fleet", "a"))
    tokens = Tokens(path, clock)
    write(path, "# nobody\n")
    clock.now += LOOK_S
    assert tokens.name_of("a") is None


@pytest.mark.parametrize("broken", ["fleet a-token-by-mistake", None])
def test_a_broken_file_leaves_the_old_one_until_it_is_mended(path, clock, caplog, broken):
    write(path, line("fleet", "a"))
    tokens = Tokens(path, clock)
    if broken is None:
        path.unlink()
    else:
        write(path, broken)
    for _ in range(3):
        clock.now += LOOK_S
        assert tokens.name_of("a") == "fleet"
    assert [record.levelno for record in caplog.records] == [logging.ERROR], "told once, not every second"
    assert "by-mistake" not in caplog.text
    write(path, line("shore", "b"))
    clock.now += LOOK_S
    assert tokens.name_of("a") is None
    assert tokens.name_of("b") == "shore"


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(None, "got: No such file"), (b"fleet", "in line 1"), (b"\xff\xfe", "expected text in the tokens file")],
)
def test_a_broken_file_stops_the_start(path, content, complaint):
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SettingsError, match=complaint):
        Tokens(path)


@pytest.mark.parametrize("name", ["", "two words", "#fleet", ".fleet", "x" * 65, "fleét"])
def test_a_name_that_the_file_cannot_hold(name):
    with pytest.raises(SettingsError, match=r"^expected a name of up to 64 letters"):
        check_name(name)


@given(name=NAMES)
def test_a_name_that_the_file_can_hold(name):
    assert check_name(name) == name
    assert parse_tokens(line(name, "t"), "tokens") == ((hash_of("t"), name),)


def test_the_command_makes_a_token_and_its_line(path, capsys):
    assert main(["token", "fleet"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    write(path, second.removeprefix("line:") + "\n")
    assert Tokens(path).name_of(first.removeprefix("token: ")) == "fleet"


def test_the_command_refuses_a_name_that_the_file_cannot_hold(capsys):
    assert main(["token", "two words"]) == 2
    assert capsys.readouterr().err.startswith("shipshape: expected a name of up to 64 letters")
