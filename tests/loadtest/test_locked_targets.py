"""Targets behind TLS that ask for a certificate and a token, through both doors."""

import asyncio

import pytest
import trustme

from serving.certificates import HOST, Files
from serving.fakes import cluster, running
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.precise import precise_loop
from shipshape.loadtest.targets import target_at
from shipshape.loadtest.targets.address import Keys, parse_address
from shipshape.loadtest.targets.target import TargetError
from shipshape.serving.tokens import hash_of

TOKEN = "t" * 43
AUTHORITY = trustme.CA()


@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    """The addresses of a service that lets in whom `keys` lets in, and a folder with what it takes."""
    folder = tmp_path_factory.mktemp("keys")
    (folder / "tokens").write_text(f"loadtest {hash_of(TOKEN)}\n")
    tester = AUTHORITY.issue_cert("loadtest.example", common_name="loadtest")
    (folder / "tester.pem").write_bytes(tester.cert_chain_pems[0].bytes())
    (folder / "tester.key").write_bytes(tester.private_key_pem.bytes())
    AUTHORITY.cert_pem.write_to_path(folder / "ca.pem")
    settings = Files(folder).write(AUTHORITY).settings(mutual=True)
    with running(**settings, tokens_file=folder / "tokens") as doors:
        yield doors.addresses, folder


def reply_of(locked, door, *, token=TOKEN, certificate=True):
    addresses, folder = locked
    shown = (folder / "tester.pem", folder / "tester.key") if certificate else (None, None)
    port = addresses.grpc_port if door == "grpcs" else addresses.rest_port
    address = parse_address(f"{door}://{HOST}:{port}", Keys(folder / "ca.pem", *shown, token), connections=2)

    async def ask():
        target = target_at(address)
        await target.open()
        try:
            return await target.send(target.encode(Request((cluster(),))), 10.0)
        finally:
            await target.close()

    with asyncio.Runner(loop_factory=precise_loop) as runner:
        return runner.run(ask())


@pytest.mark.parametrize("door", ["grpcs", "https"])
def test_with_all_keys_it_is_let_in(locked, door):
    assert reply_of(locked, door).outcome is Outcome.OK


@pytest.mark.parametrize("door", ["grpcs", "https"])
@pytest.mark.parametrize("lacking", [{"token": ""}, {"token": "x" * 43}, {"certificate": False}], ids=str)
def test_without_one_of_them_it_is_told_so(locked, door, lacking):
    with pytest.raises(TargetError, match=r"^expected "):
        reply_of(locked, door, **lacking)
