"""Campaigns of the store in the form that an identification reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from api.files import NORMALISED, Files
from api.reading.campaign_text import campaign_of_text
from api.reading.stored import Samples
from api.stores.entities import Store
from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import Recording

ReadCut = Callable[[Cut], tuple[Recording, Recording | None]]
ReadTest = Callable[[HammerTest], tuple[FloatArray, ComplexArray]]


def load_campaign(store: Store, files: Files, group: str, campaign_id: str) -> tuple[Campaign, ReadCut, ReadTest]:
    """Return a campaign with the cuts and hammer tests that have files, and picklable functions that read them.

    Raises `InputError`: the campaign has been deleted, or none of its cuts and hammer tests has a file.
    """
    row = store.campaigns.get(group, campaign_id)
    if row is None:
        raise InputError("campaign", f'"{campaign_id}"', "an existing campaign")
    listed = store.recordings.list(group, campaign_id, "", 1_000_000)
    paths = {each.name: files.path(group, NORMALISED, each.normalised) for each in listed}
    samples = Samples({paths[each.name]: each.samples for each in listed})

    def locate(name: str) -> Path:
        return paths.get(name, Path())

    found = campaign_of_text(row.text, locate)
    there = [cut for cut in found.cuts if cut.recording != Path()]
    tests = tuple(test for test in found.tests if test.file != Path())
    if not there and not tests:
        raise InputError("campaign", "no recording of a cut", "a campaign with recordings")
    cuts = tuple(replace(cut, air=None) if cut.air == Path() else cut for cut in there)
    return replace(found, cuts=cuts, tests=tests), partial(_read_whole, samples), partial(_read_test, samples)


def _read_whole(samples: Samples, cut: Cut) -> tuple[Recording, Recording | None]:
    from api.reading.samples import read_cut_normalised

    for path in (cut.recording, cut.air):
        if path is not None:
            samples.check(path)
    return read_cut_normalised(cut)


def _read_test(samples: Samples, test: HammerTest) -> tuple[FloatArray, ComplexArray]:
    from api.reading.hammer_files import read_stored

    samples.check(test.file)
    return read_stored(test)
