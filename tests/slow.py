"""Tests that take long and repeat, on more cases, what faster ones hold: left out unless `PMG_SLOW` is set."""

from __future__ import annotations

import os

import pytest

SLOW = bool(os.environ.get("PMG_SLOW"))
"""Whether they are run."""

slow = pytest.mark.skipif(not SLOW, reason="one of many alike that takes long; PMG_SLOW=1 tries it")
"""Mark of a test, or of one of its cases."""
