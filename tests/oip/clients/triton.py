"""Everything our tests ask of Triton's own clients: `triton.py REST GRPC SCAN.npz` prints JSON."""

import importlib
import json
import sys

import numpy as np

NAMES = ["contact_id", "vessel", "probability", "heading", "box"]


def listed(result, names):
    """The outputs as lists; BYTES as text, which they are already when they came in JSON."""
    return {
        name: [item.decode() if isinstance(item, bytes) else item for item in result.as_numpy(name).tolist()]
        for name in names
    }


def tensor(triton, name, datatype, array, **form):
    made = triton.InferInput(name, list(array.shape), datatype)
    made.set_data_from_numpy(array, **form)
    return made


def ask(triton, client, scan, form, outputs):
    inputs = [
        tensor(triton, "points", "FP32", scan["points"], **form),
        tensor(triton, "counts", "INT32", scan["n"].astype(np.int32), **form),
        tensor(triton, "contact_id", "BYTES", np.array([b"%d" % n for n in scan["n"]], object), **form),
        tensor(triton, "sensor_height_m", "FP64", np.full(len(scan["n"]), np.nan), **form),
    ]
    wanted = [triton.InferRequestedOutput(name, **outputs) for name in NAMES]
    result = client.infer("shipshape", inputs, outputs=wanted, request_id="42", timeout=9_000_000)
    return listed(result, NAMES)


def refusals(triton, client, errors):
    few = tensor(triton, "points", "FP32", np.zeros((3, 3), np.float32))
    double = tensor(triton, "points", "FP64", np.zeros((30, 3)))
    for name, inputs in (("shipshape", [few]), ("shipshape", [double]), ("other", [few])):
        try:
            client.infer(name, inputs)
        except errors.InferenceServerException as error:
            yield [error.status(), error.message()]


def report(kind, address, scan):
    triton, errors = importlib.import_module(f"tritonclient.{kind}"), importlib.import_module("tritonclient.utils")
    client = triton.InferenceServerClient(address)
    as_json = {"as_json": True} if kind == "grpc" else {}
    server, model = client.get_server_metadata(**as_json), client.get_model_metadata("shipshape", **as_json)
    binary = [{"binary_data": True}, {"binary_data": False}] if kind == "http" else [{}]
    everything = client.infer("shipshape", [tensor(triton, "points", "FP32", scan["points"][: scan["n"][0]])])
    return {
        "live": client.is_server_live(),
        "ready": client.is_server_ready(),
        "model_ready": client.is_model_ready("shipshape"),
        "other_ready": client.is_model_ready("other") if kind == "http" else False,
        "server": server["name"],
        "inputs": [each["name"] for each in model["inputs"]],
        "answers": [ask(triton, client, scan, form, form) for form in binary],
        "alone": listed(everything, ["vessel", "probabilities", "unknown", "error"]),
        "refusals": list(refusals(triton, client, errors)),
    }


def main():
    rest, grpc, path = sys.argv[1:]
    scan = np.load(path, allow_pickle=False)
    print(json.dumps({"rest": report("http", rest, scan), "grpc": report("grpc", grpc, scan)}))


if __name__ == "__main__":
    main()
