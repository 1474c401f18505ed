"""PyTriton: an instance of the callable a core behind Triton, Open Inference Protocol with binary tensors."""

import json
import os
import sysconfig

import numpy as np
from pytriton.model_config import ModelConfig, Tensor
from pytriton.triton import Triton, TritonConfig

from benchmarks.serving.peers.recognise import CORES, HOST, PORT, load, recognise

pipeline = load()


def infer(requests: list) -> list[dict]:
    """One contact a request."""
    answers = [json.dumps(recognise(pipeline, request["points"])) for request in requests]
    return [{"answer": np.array([answer.encode()])} for answer in answers]


if __name__ == "__main__":
    # Triton's own Python must be that of the standard library it finds, as PyTriton's installation page says.
    os.environ["LD_LIBRARY_PATH"] = sysconfig.get_config_var("LIBDIR")
    config = TritonConfig(http_address=HOST, http_port=PORT, grpc_port=PORT + 1, metrics_port=PORT + 2)
    with Triton(config=config) as triton:
        triton.bind(
            model_name="recognise",
            infer_func=[infer] * CORES,
            inputs=[Tensor(name="points", dtype=np.float32, shape=(-1, 3))],
            outputs=[Tensor(name="answer", dtype=bytes, shape=(1,))],
            config=ModelConfig(batching=False),
        )
        triton.serve()
