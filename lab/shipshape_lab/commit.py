"""Which code made a bundle or a result."""

import subprocess


def code_commit() -> str:
    """Short commit of the checkout in the current directory, with -dirty where it has uncommitted changes."""
    found = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"
