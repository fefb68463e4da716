"""The list of mutations is up to date: each changes one place, and its tests are there."""

from __future__ import annotations

import pytest

from tests.mutants.__main__ import ROOT, Mutant, listed


@pytest.mark.parametrize("mutant", listed(), ids=lambda mutant: f"{mutant.file}: {mutant.new}")
def test_a_mutation_has_one_place_and_tests(mutant: Mutant) -> None:
    text = (ROOT / "uavexp" / f"{mutant.file}.py").read_text(encoding="utf-8")
    assert text.count(mutant.old) == 1
    assert mutant.old != mutant.new
    assert all((ROOT / "tests" / part).exists() for part in mutant.tests.split())
