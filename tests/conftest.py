from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pmg.sim.bench import BenchParameters, load_bench

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def bench() -> BenchParameters:
    return load_bench()


@pytest.fixture(scope="session")
def published_folder() -> Path:
    return ROOT / "raw" / "published"
