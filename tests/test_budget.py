import pytest

from shipshape.budget import ERROR_S, WARN_S, Budget, Level


class HandClock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def budget(clock):
    return Budget(0.05, clock)


def test_nothing_asked_is_fine(budget):
    report = budget.report()
    assert (report.level, report.good, report.bad, report.last_good_s) == (Level.OK, 0, 0, None)
    assert set(report.burn.values()) == {0.0}


def test_one_answer_over_budget_warns_for_a_while(budget, clock):
    assert budget.tell(0.049, answered=True)
    assert not budget.tell(0.051, answered=True)
    assert budget.report().level is Level.WARN
    budget.tell(0.01, answered=True)
    clock.now += WARN_S
    assert budget.report().level is Level.WARN
    clock.now += 0.1
    assert budget.report().level is Level.OK


def test_no_good_answer_for_too_long_is_an_error_until_there_is_one(budget, clock):
    budget.tell(0.01, answered=True)
    clock.now += ERROR_S / 2
    budget.tell(0.0, answered=False)
    assert budget.report().level is Level.WARN
    clock.now += ERROR_S
    assert budget.report().level is Level.ERROR
    assert budget.report().last_good_s == pytest.approx(1.5 * ERROR_S)
    budget.tell(0.01, answered=True)
    assert budget.report().level is Level.WARN


def test_a_start_with_nothing_but_bad_answers_is_an_error(budget, clock):
    budget.tell(1.0, answered=True)
    assert budget.report().level is Level.WARN
    clock.now += ERROR_S + 0.1
    assert budget.report().level is Level.ERROR


def test_silence_is_no_error(budget, clock):
    budget.tell(0.01, answered=True)
    clock.now += 1e5
    assert budget.report().level is Level.OK


def test_burn_is_the_share_of_bad_over_what_is_allowed(budget, clock):
    for number in range(100):
        budget.tell(1.0 if number < 2 else 0.01, answered=True)
    assert budget.report().burn == pytest.approx({"5m": 2.0, "1h": 2.0})
    clock.now += 301
    for _ in range(100):
        budget.tell(0.01, answered=True)
    assert budget.report().burn == pytest.approx({"5m": 0.0, "1h": 1.0})
    clock.now += 3601
    assert set(budget.report().burn.values()) == {0.0}
    assert budget.report().good == 198
