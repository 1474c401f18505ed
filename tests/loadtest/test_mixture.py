"""What requests hold: sizes and lanes in the shares asked for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from loadtest.simulated import CLUSTER, plan_of
from shipshape.errors import FileError, SettingsError
from shipshape.loadtest.mixture import Mixture, cut
from shipshape.loadtest.quantities import seconds_of, weights_of
from shipshape.sample import sample_contact

RNG_SEED = 7


def sizes_of(weights, clusters=None):
    clusters = [sample_contact().points_level] if clusters is None else clusters
    return cut(clusters, weights, np.random.default_rng(RNG_SEED))


def test_single_contacts_come_in_the_shares_asked_for():
    mixture = Mixture(sizes_of({50: 2.0, 300: 7.0, 2000: 1.0}), {"collision": 1.0, "batch": 3.0})
    plan = plan_of(1000.0, 20.0, mixture=mixture)
    sent = [plan.requests[index] for index in plan.request]
    sizes = np.array([len(request.clusters[0]) for request in sent])
    assert [np.mean(sizes == size) for size in (50, 300, 2000)] == pytest.approx([0.2, 0.7, 0.1], abs=0.015)
    assert np.mean([request.lane == "batch" for request in sent]) == pytest.approx(0.75, abs=0.015)
    assert {label for request in plan.requests for label in request.labels} == {
        "50 points", "300 points", "2000 points", "lane collision", "lane batch",
    }  # fmt: skip


def test_scans_hold_as_many_contacts_as_asked_for():
    plan = plan_of(100.0, 5.0, mixture=Mixture(sizes_of({50: 1.0, 300: 1.0}), {"": 1.0}), contacts=6)
    assert set(plan.contacts.tolist()) == {6}
    drawn = np.array([len(cluster) for request in plan.requests for cluster in request.clusters])
    assert 0.3 < np.mean(drawn == 50) < 0.7
    assert plan.requests[0].labels == ("6 contacts",)


@given(size=st.integers(1, 3000))
def test_a_cut_cluster_has_the_size_and_lies_where_the_whole_lies(size):
    whole = sample_contact().points_level
    ((cluster, weight),) = sizes_of({size: 1.0})
    assert cluster.shape == (size, 3)
    assert cluster.dtype == np.float32
    assert weight == 1.0
    assert (cluster.min(0) >= whole.min(0) - 0.1).all()
    assert (cluster.max(0) <= whole.max(0) + 0.1).all()
    assert len(np.unique(cluster, axis=0)) >= min(size, len(np.unique(whole, axis=0))) * 0.95


def test_without_sizes_clusters_are_sent_as_they_are():
    found = sizes_of({}, [CLUSTER, CLUSTER[:4]])
    assert [len(cluster) for cluster, _ in found] == [10, 4]


@pytest.mark.parametrize("clusters", [[], [CLUSTER, CLUSTER[:0]]])
def test_no_points_at_all_are_refused(clusters):
    with pytest.raises(FileError, match=r"^expected clusters of one point or more, got none"):
        sizes_of({50: 1.0}, clusters)


@pytest.mark.parametrize(
    ("text", "seconds"), [("50ms", 0.05), ("2s", 2.0), ("1.5m", 90.0), ("3", 3.0), ("250us", 0.00025)]
)
def test_times(text, seconds):
    assert seconds_of(text) == pytest.approx(seconds)


@pytest.mark.parametrize("text", ["", "0s", "-1s", "1 s", "1d", "nan", "inf", "1e3"])
def test_what_is_no_time_is_refused(text):
    with pytest.raises(SettingsError, match="expected a time like"):
        seconds_of(text)


def test_weights():
    assert weights_of("50, 300=8,2000=0.5") == {"50": 1.0, "300": 8.0, "2000": 0.5}


@pytest.mark.parametrize("text", ["", "50,", "50,50", "50=0", "50=-1", "50=x", "50=inf", "50=nan", "=3"])
def test_what_are_no_weights_is_refused(text):
    with pytest.raises(SettingsError, match="expected a list like"):
        weights_of(text)
