import pytest

from client.scripted import Scripted, serving
from serving.fakes import doors

__all__ = ["aboard", "doors", "shore"]


@pytest.fixture
def aboard():
    with serving(Scripted("aboard")) as service:
        yield service


@pytest.fixture
def shore():
    with serving(Scripted("shore")) as service:
        yield service
