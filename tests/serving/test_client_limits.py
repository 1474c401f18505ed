import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.errors import Overloaded
from shipshape.serving import clients as module
from shipshape.serving.clients import RATE, UNDER_WAY, ClientLimits, Clients, client_name

RATES = st.floats(0.1, 1e4)


class Clock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


class Scene:
    """Clients on a clock of their own, with the reasons why some were refused."""

    def __init__(self, **limits):
        self.clock, self.reasons = Clock(), []
        self.clients = Clients(ClientLimits(**limits), self.reasons.append, self.clock)

    def ask(self, contacts=1, client="a"):
        """A request that ends at once."""
        with self.clients.share(client) as share:
            share.take(contacts)

    def admitted(self, contacts=1, client="a"):
        try:
            self.ask(contacts, client)
        except Overloaded:
            return False
        return True


def test_without_limits_everybody_may_ask_anything():
    scene = Scene()
    assert all(scene.admitted(1_000_000) for _ in range(10))
    assert scene.reasons == []


def test_a_burst_passes_then_the_rate_holds():
    scene = Scene(contacts_per_s=10.0, burst=20)
    assert [scene.admitted() for _ in range(21)] == [True] * 20 + [False]
    scene.clock.now += 0.5
    assert [scene.admitted() for _ in range(6)] == [True] * 5 + [False]
    scene.clock.now += 3600.0
    assert [scene.admitted() for _ in range(21)] == [True] * 20 + [False], "a rest earns one burst, no more"
    assert scene.reasons == [RATE] * 3


def test_a_refusal_says_when_there_will_be_room():
    scene = Scene(contacts_per_s=10.0, burst=20)
    scene.ask(18)
    with pytest.raises(Overloaded) as caught:
        scene.ask(7)
    assert caught.value.retry_after_s == pytest.approx(0.5)
    assert str(caught.value) == (
        "expected at most 10 contacts a second of one client, 20 at once, got 7 more: there will be room in 0.5 s"
    )


def test_a_refused_scan_costs_nothing():
    scene = Scene(contacts_per_s=10.0, burst=20)
    scene.ask(10)
    assert not scene.admitted(11)
    assert scene.admitted(10)


def test_one_clients_flood_is_not_anothers():
    scene = Scene(contacts_per_s=1.0, burst=5, under_way=5)
    assert [scene.admitted(5, "flood"), scene.admitted(1, "flood"), scene.admitted(5, "other")] == [
        True,
        False,
        True,
    ]


@given(rate=RATES, burst=st.integers(1, 1000), steps=st.lists(st.tuples(st.floats(0, 10), st.integers(1, 50))))
def test_never_more_than_the_burst_and_the_rate_allow(rate, burst, steps):
    scene = Scene(contacts_per_s=rate, burst=burst)
    passed = 0
    for wait, contacts in steps:
        scene.clock.now += wait
        passed += contacts if scene.admitted(contacts) else 0
        assert passed <= burst + rate * (scene.clock.now - 1000.0) + 1e-6


@given(rate=RATES, burst=st.integers(1, 1000), data=st.data())
def test_who_comes_back_when_told_is_let_in_and_not_much_later_than_needed(rate, burst, data):
    scene = Scene(contacts_per_s=rate, burst=burst)
    scene.ask(burst)
    contacts = data.draw(st.integers(1, burst))
    with pytest.raises(Overloaded) as caught:
        scene.ask(contacts)
    wait = caught.value.retry_after_s
    scene.clock.now += wait * 0.99
    assert not scene.admitted(contacts)
    scene.clock.now += wait * 0.01 + 1e-9
    assert scene.admitted(contacts)


def test_contacts_under_way_are_given_back_at_the_end():
    scene = Scene(under_way=4)
    with scene.clients.share("a") as first:
        first.take(3)
        assert scene.admitted(1)
        with pytest.raises(Overloaded) as caught:
            scene.ask(2)
    assert str(caught.value) == "expected at most 4 contacts of one client under way, got 2 beside 3"
    assert caught.value.retry_after_s is None, "nobody knows when its own answers will be there"
    assert scene.admitted(4)
    assert scene.reasons == [UNDER_WAY]


def test_contacts_under_way_are_given_back_when_the_request_fails():
    scene = Scene(under_way=1)

    def fail():
        with scene.clients.share("a") as share:
            share.take(1)
            raise ZeroDivisionError

    for _ in range(3):
        with pytest.raises(ZeroDivisionError):
            fail()
    assert scene.admitted()


def test_what_was_refused_is_not_given_back():
    scene = Scene(under_way=2)
    with scene.clients.share("a") as first:
        first.take(2)
        assert not scene.admitted()
        assert not scene.admitted(), "the refused one has not made room"


def test_the_concurrency_limit_spends_nothing_of_the_rate():
    scene = Scene(contacts_per_s=1.0, burst=2, under_way=1)
    with scene.clients.share("a") as first:
        first.take(1)
        assert not scene.admitted()
    assert scene.admitted()


def test_memory_is_bounded_and_who_is_busy_is_remembered(monkeypatch):
    monkeypatch.setattr(module, "MOST_CLIENTS", 10)
    scene = Scene(contacts_per_s=1.0, burst=1, under_way=5)
    with scene.clients.share("busy") as share:
        share.take(1)
        for number in range(1000):
            assert scene.admitted(1, f"stranger {number}")
        assert len(scene.clients._accounts) == 10
        assert not scene.admitted(1, "stranger 999"), "the latest are remembered"
        assert scene.admitted(1, "stranger 0"), "the oldest begin anew"
        assert not scene.admitted(1, "busy")


def test_everybody_busy_is_nobody_forgotten(monkeypatch):
    monkeypatch.setattr(module, "MOST_CLIENTS", 2)
    scene = Scene(under_way=1)
    shares = [scene.clients.share(str(number)) for number in range(4)]
    for share in shares:
        share.take(1)
    assert [scene.admitted(1, str(number)) for number in range(4)] == [False] * 4
    for share in shares:
        share.__exit__(None, None, None)
    assert [scene.admitted(1, str(number)) for number in range(4)] == [True] * 4


def test_threads_do_not_lose_count():
    scene = Scene(under_way=1_000_000)

    def ask():
        for _ in range(500):
            scene.ask(3)

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert scene.clients._accounts["a"].under_way == 0


@pytest.mark.parametrize(
    ("token", "certificate", "address", "name"),
    [
        ("fleet", "boat-7", "10.0.0.1", "token fleet"),
        (None, "boat-7", "10.0.0.1", "certificate boat-7"),
        (None, None, "10.0.0.1", "address 10.0.0.1"),
        (None, None, "2001:db8:1:2:aaaa::1", "address 2001:db8:1:2::/64"),
        (None, None, "2001:db8:1:2:bbbb::9", "address 2001:db8:1:2::/64"),
        (None, None, "", "address "),
    ],
)
def test_who_a_client_is(token, certificate, address, name):
    assert client_name(token, certificate, address) == name


def test_nobody_can_pose_as_another_by_a_name():
    assert len({client_name("x", None, ""), client_name(None, "x", ""), client_name(None, None, "x")}) == 3
