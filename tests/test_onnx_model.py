import numpy as np
import pytest
from onnx import TensorProto

from builders_onnx import doubling_onnx
from shipshape.errors import BundleError
from shipshape.onnx_model import OnnxModel, Signature, TensorSpec

SIGNATURE = Signature(
    inputs=(TensorSpec("x", (-1, 3), "float32"),),
    outputs=(TensorSpec("doubled", (-1, 3), "float32"), TensorSpec("sums", (-1,), "float32")),
)


@pytest.mark.parametrize("rows", [0, 1, 7])
def test_outputs_come_in_the_order_of_the_signature(rows):
    x = np.arange(rows * 3, dtype=np.float32).reshape(rows, 3)
    doubled, sums = OnnxModel(doubling_onnx(), SIGNATURE).run(x=x)
    np.testing.assert_array_equal(doubled, 2 * x)
    np.testing.assert_array_equal(sums, x.sum(axis=1))


def test_a_file_states_its_own_signature(tmp_path):
    path = tmp_path / "doubling.onnx"
    path.write_bytes(doubling_onnx())
    assert OnnxModel(path).signature == SIGNATURE


@pytest.mark.parametrize(
    ("content", "came"),
    [
        (doubling_onnx(input_name="y"), r"y float32\[-1, 3\]"),
        (doubling_onnx(columns=4), r"x float32\[-1, 4\]"),
        (doubling_onnx(columns="m"), r"x float32\[-1, -1\]"),
        (doubling_onnx(dtype=TensorProto.DOUBLE), r"x float64\[-1, 3\]"),
    ],
    ids=["name", "fixed dimension", "free dimension", "dtype"],
)
def test_another_signature_is_refused(content, came):
    with pytest.raises(BundleError, match=rf"prior\.onnx .* x float32\[-1, 3\], got {came}"):
        OnnxModel(content, SIGNATURE, label="prior.onnx")


@pytest.mark.parametrize("kept", [0, 1, 50, 150])
def test_a_truncated_file_is_refused_in_one_sentence(kept, capfd):
    with pytest.raises(BundleError, match=rf"expected prior\.onnx to be a complete .* got {kept} bytes") as caught:
        OnnxModel(doubling_onnx()[:kept], label="prior.onnx")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(BundleError, match=r"gone\.onnx, got: No such file"):
        OnnxModel(tmp_path / "gone.onnx")


@pytest.mark.parametrize(
    ("inputs", "given"),
    [
        ({"x": np.zeros((1, 4), np.float32)}, r"x float32\[1, 4\]"),
        ({"x": np.zeros((1, 3))}, r"x float64\[1, 3\]"),
        ({"y": np.zeros((1, 3), np.float32)}, r"y float32\[1, 3\]"),
    ],
    ids=["shape", "dtype", "name"],
)
def test_a_network_for_other_inputs_is_the_bundles_fault(inputs, given, capfd):
    model = OnnxModel(doubling_onnx(), label="prior.onnx")
    sentence = rf"expected prior\.onnx to take {given}, got a network for x float32\[-1, 3\]"
    with pytest.raises(BundleError, match=sentence):
        model.run(**inputs)
    assert capfd.readouterr() == ("", "")
