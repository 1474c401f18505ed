import pytest

from faults.live import live


@pytest.fixture(scope="session")
def service(tmp_path_factory):
    """One process for all faults that it has to survive: each finds it as the one before must have left it."""
    with live(tmp_path_factory.mktemp("faults")) as service:
        yield service
