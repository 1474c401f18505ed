"""Thousands of good and bad requests through all doors; then only good ones, and all of them are answered."""

import itertools
import json
import queue
import random
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import grpc
import httpx
import numpy as np

from faults.live import HEIGHT_M, MAX_CONTACTS, PACKED, PATIENCE, POINTS
from oip.wire import HEADER, INFER, binary, message
from serving.fakes import request, rows
from shipshape.v1 import shipshape_pb2 as pb

MIXED, GOOD, CLIENTS = 10_000, 400, 16
SENT = POINTS.tobytes()
FEW = SENT[: 3 * 12]
NAN = np.full((20, 3), np.nan, "<f4").tobytes()
JSON = {"content-type": "application/json"}
NPY = (
    b"\x93NUMPY\x01\x00v\x00"
    + ("{'descr': '<f4', 'fortran_order': False, 'shape': (40, 3), }".ljust(117) + "\n").encode()
)
CLOUD = {"fields": "x:0:7,y:4:7,z:8:7", "width": 40, "height": 1, "point_step": 12}
INFER_BODY, INFER_JSON = binary({"points": POINTS})
STREAM_GOOD, STREAM_BAD = (
    pb.RecogniseStreamRequest(sequence=1, contacts=[pb.Contact(points=points)]) for points in (SENT, FEW)
)


def rest(path, content, headers, **query):
    return lambda live: live.rest.post(path, content=content, headers=headers, params=query).status_code


def as_json(path, body):
    return rest(path, json.dumps(body).encode(), JSON)


def unary(method, raw):
    def ask(live):
        call = live.channel.unary_unary(method).future(raw, timeout=PATIENCE)
        call.exception(PATIENCE)
        return call.code().name

    return ask


def stream(*messages):
    def ask(live):
        call = live.stub.RecogniseStream(iter(messages), timeout=PATIENCE)
        try:
            return sorted(bool(answer.results and not answer.results[0].error.kind) for answer in call)
        except grpc.RpcError as error:
            return error.code().name

    return ask


V1, OIP = "/shipshape.v1.Shipshape/", "/inference.GRPCInferenceService/ModelInfer"
NPY_FORM = {"content-type": "application/x-npy"}
CLOUD_FORM = {"content-type": "application/vnd.shipshape.pointcloud2"}
SCAN = pb.RecogniseScanRequest(contacts=[pb.Contact(points=SENT), pb.Contact(points=FEW)])
TOO_MANY = pb.RecogniseScanRequest(contacts=[pb.Contact()] * (MAX_CONTACTS + 1))
GOOD_ASKS = {
    "json": (as_json("/v1/recognise", {"points": rows(POINTS)}), 200),
    "json scan": (as_json("/v1/scan", {"contacts": [{"points": rows(POINTS)}, {"points": []}]}), 200),
    "binary": (rest("/v1/recognise", SENT, PACKED, sensor_height_m=HEIGHT_M), 200),
    "binary scan": (rest("/v1/scan", SENT * 2, PACKED, counts="40,40"), 200),
    "npy": (rest("/v1/recognise", NPY + SENT, NPY_FORM), 200),
    "pointcloud2": (rest("/v1/recognise", SENT, CLOUD_FORM, **CLOUD), 200),
    "oip": (rest(INFER, INFER_BODY, {HEADER: str(INFER_JSON)}), 200),
    "unary": (unary(V1 + "Recognise", request(POINTS).SerializeToString()), "OK"),
    "scan": (unary(V1 + "RecogniseScan", SCAN.SerializeToString()), "OK"),
    "stream": (stream(STREAM_GOOD, STREAM_BAD), [False, True]),
    "oip unary": (unary(OIP, message({"points": POINTS}).SerializeToString()), "OK"),
}
BAD_ASKS = {
    "json of few points": (as_json("/v1/recognise", {"points": rows(POINTS[:3])}), 422),
    "json of another field": (as_json("/v1/recognise", {"points": [], "colour": "red"}), 400),
    "json cut off": (rest("/v1/recognise", b'{"points": [[1,', JSON), 400),
    "json of too many": (as_json("/v1/scan", {"contacts": [{}] * (MAX_CONTACTS + 1)}), 413),
    "binary of few points": (rest("/v1/recognise", FEW, PACKED), 422),
    "binary of NaN": (rest("/v1/recognise", NAN, PACKED), 422),
    "binary cut off": (rest("/v1/recognise", SENT[:-1], PACKED), 400),
    "binary of another lane": (rest("/v1/recognise", SENT, PACKED, lane="fast"), 400),
    "counts that lie": (rest("/v1/scan", SENT, PACKED, counts="40,40"), 400),
    "npy cut off": (rest("/v1/recognise", NPY + SENT[:-1], NPY_FORM), 400),
    "pointcloud2 that lies": (rest("/v1/recognise", SENT, CLOUD_FORM, **CLOUD | {"width": 41}), 400),
    "another form": (rest("/v1/recognise", SENT, {"content-type": "image/png"}), 415),
    "compressed": (rest("/v1/recognise", SENT, PACKED | {"content-encoding": "gzip"}), 415),
    "oip cut off": (rest(INFER, INFER_BODY[:-1], {HEADER: str(INFER_JSON)}), 400),
    "another path": (rest("/v1/recognize", SENT, PACKED), 404),
    "unary of few points": (unary(V1 + "Recognise", request(FEW).SerializeToString()), "INVALID_ARGUMENT"),
    "no message": (unary(V1 + "Recognise", b"\xff" * 9), "INVALID_ARGUMENT"),
    "scan of too many": (unary(V1 + "RecogniseScan", TOO_MANY.SerializeToString()), "INVALID_ARGUMENT"),
    "oip without points": (unary(OIP, message({}).SerializeToString()), "INVALID_ARGUMENT"),
    "another method": (unary(V1 + "Recognize", b""), "UNIMPLEMENTED"),
    "a late one": (rest("/v1/recognise", SENT, PACKED, captured_at=1, max_age_ms=1), 504),
}
CRASH = (rest("/v1/recognise", SENT, PACKED, contact_id="crash"), 500)


@contextmanager
def callers_of(service):
    """One for each thread, with its own connection: one that threads share may be closed under them."""
    with ExitStack() as stack:
        callers = queue.SimpleQueue()
        for _ in range(CLIENTS):
            client = httpx.Client(base_url=service.rest.base_url, timeout=PATIENCE, trust_env=False)
            callers.put(replace(service, rest=stack.enter_context(client)))
        yield callers


def test_ten_thousand_good_and_bad_requests_then_all_good_ones(service):
    draw = random.Random(0)
    everything = {**GOOD_ASKS, **BAD_ASKS, "crash": CRASH}
    names = draw.choices(sorted(everything), k=MIXED)
    with (
        service.survives(internal=names.count("crash")),
        callers_of(service) as callers,
        ThreadPoolExecutor(CLIENTS) as pool,
    ):

        def ask(name):
            """By whoever is free."""
            caller = callers.get()
            try:
                return everything[name][0](caller)
            finally:
                callers.put(caller)

        found = pool.map(ask, names)
        wrong = [(name, end) for name, end in zip(names, found, strict=True) if end != everything[name][1]]
        assert wrong == []
        names = list(itertools.islice(itertools.cycle(GOOD_ASKS), GOOD))
        found = list(pool.map(ask, names))
        assert found == [GOOD_ASKS[name][1] for name in names]
