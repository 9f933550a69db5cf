"""The sample's joints, and made of them what is compared."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_sample import SAMPLE


@pytest.fixture(scope="module")
def recorded():
    with np.load(SAMPLE) as data:
        return {name: data[name] for name in data.files}
