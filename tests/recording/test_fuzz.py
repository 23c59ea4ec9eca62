"""Mutated recordings: what is kept was recorded, and what is missing is reported."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from .mutations import FAULTS, KINDS, Outcome, Specimen, mutate, outcome, specimens
from .text_mutations import SPECIMENS as TEXTS
from .text_mutations import TextOutcome, TextSpecimen, text_outcome, text_outcomes

SPECIMENS = specimens()


@pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda specimen: specimen.name)
def test_every_mutation_leaves_a_part_of_the_truth_or_a_finding(specimen: Specimen, rng: np.random.Generator) -> None:
    counts = Counter(outcome(mutate(kind, specimen, rng), specimen.truth) for kind in KINDS for _ in range(50))
    assert counts.total() == 200
    assert not any(counts[fault] for fault in FAULTS), counts
    if specimen.chunks:
        assert not counts[Outcome.DOUBTED], counts
    if "all data" in specimen.name:
        assert not counts[Outcome.ALTERED], counts
    assert counts[Outcome.PART] > 20


def test_the_count_of_outcomes_sees_faults() -> None:
    specimen = SPECIMENS[0]
    truth = specimen.truth
    message = Counter([next(iter(truth.messages))])
    assert outcome(specimen.data, specimen.truth) is Outcome.UNTOUCHED
    assert outcome(specimen.data, replace(truth, messages=truth.messages + message)) is Outcome.SILENT
    assert outcome(specimen.data, replace(truth, messages=truth.messages - message)) is Outcome.FALSE
    assert outcome(specimen.data, replace(truth, words="")) is Outcome.ALTERED
    assert outcome(specimen.data[:4], specimen.truth) is Outcome.REFUSED


@pytest.mark.parametrize("specimen", TEXTS, ids=lambda specimen: specimen.name)
def test_a_mutated_text_ends_with_a_result_or_a_sentence(specimen: TextSpecimen, rng: np.random.Generator) -> None:
    assert text_outcome(specimen, specimen.text.encode()) == (TextOutcome.RESULT, "")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        counts = text_outcomes(specimen, 20, rng)
    assert sum(counts.values(), Counter()).keys() <= {TextOutcome.RESULT, TextOutcome.REFUSED}
