import re

from architecture.tree import name, tracked

# In parts, so that this file does not find itself.
FOREIGN = {
    "a path of somebody's machine": r"(?<![\w.])/(?:home|root|work|Users)/" + r"\w",
    "a package registry": r"(?:py"
    + r"pi\.org|python"
    + r"hosted\.org|file:"
    + r"///|--(?:extra-)?index"
    + r"-url[ =])",
}
TEXT = {
    ".py",
    ".pyi",
    ".md",
    ".toml",
    ".txt",
    ".in",
    ".lock",
    ".yaml",
    ".yml",
    ".json",
    ".sh",
    ".proto",
    ".csv",
    "",
}


def test_nothing_of_one_machine_or_registry_is_tracked():
    found = [
        f"{name(path)}: {what}: {match[0]}"
        for path in tracked()
        if path.suffix in TEXT
        for what, pattern in FOREIGN.items()
        if (match := re.search(pattern, path.read_text(encoding="utf-8", errors="replace")))
    ]
    assert found == []


def test_large_files_stay_out():
    assert [name(path) for path in tracked() if path.stat().st_size > 10 * 2**20] == []


def test_torch_is_in_no_group_that_is_installed_by_default():
    for lock in tracked("requirements/*.lock"):
        assert not re.search(r"^(?:torch|nvidia|triton\b)", lock.read_text(), re.M), name(lock)
