import jaxtyping
import numpy as np
import pytest

from shipshape.stages import spd2

CLOUD = np.zeros((4, 3), np.float32)


@pytest.mark.parametrize(
    "points", [CLOUD[:, :2], CLOUD.astype(np.float64), CLOUD.tolist()], ids=["2 columns", "float64", "list"]
)
def test_a_wrong_shape_dtype_or_type_fails_while_tests_run(points):
    with pytest.raises(jaxtyping.TypeCheckError):
        spd2.describe(points, CLOUD, 1.0)
