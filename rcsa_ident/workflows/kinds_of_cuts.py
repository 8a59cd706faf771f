"""Cuts of one kind, whose forces have one law: which they are, and what the factors on their forces say of that law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.cutting.force_law import KnownFactors, fit_law, law_changes
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.learned_changes import LearnedChanges
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading

#: Cuts of one engagement and feed that have factors of their own on their forces.
_FEWEST = 6


def kinds_of(campaign: Campaign, ids: Sequence[str]) -> np.ndarray:
    """Return the kind of each cut, shape (k,): the forces of cuts that engage alike, with one feed per tooth, are wrong alike."""
    cuts = {cut.id: cut for cut in campaign.cuts}
    alike = [_kind(cuts[id]) if id in cuts else () for id in ids]
    known = {each: k for k, each in enumerate(dict.fromkeys(alike))}
    kind = np.array([known[each] for each in alike])
    # of few cuts a factor of their own is not told apart from the machine
    return kind if np.min(np.bincount(kind)) >= _FEWEST else np.zeros_like(kind)


def _kind(cut: Cut) -> tuple[object, ...]:
    made = cut.conditions
    return str(made.engagement), f"{made.feed_angle:.3g}", f"{made.feed_per_tooth:.3g}"


def with_law(changes: LearnedChanges, campaign: Campaign, readings: Sequence[Reading]) -> LearnedChanges:
    """Return what was learned with the law of the force that stands behind its factors; as it is where no factors were learned."""
    ids = [each.cut_id for each in readings for _ in each.measurements]
    if not changes.orders or not ids:
        return changes
    cuts, kinds = {cut.id: cut for cut in campaign.cuts}, kinds_of(campaign, ids)
    known = []
    for kind in np.unique(kinds).tolist():
        own = [(axis, order, each) for (axis, k, order), each in changes.orders.items() if k == kind]
        orders = np.array([order for _, order, _ in own], dtype=np.intp)
        first: dict[str, Cut] = {}
        for id, other in zip(ids, kinds.tolist(), strict=True):
            if other == kind and id in cuts:
                first.setdefault(cuts[id].tooling, cuts[id])
        change, count = np.zeros((orders.size, 2, 6), dtype=complex), np.zeros(orders.size)
        for tooling, cut in first.items():
            cutter = campaign.toolings[tooling].cutter
            has = orders % cutter.repeats == 0
            change[has] += law_changes(cutter, cut.conditions, campaign.coefficients, orders[has])
            count[has] += 1.0
        # cutters of one kind of cut differ by little in it
        change /= np.maximum(count, 1.0)[:, None, None]
        rows = np.array([0 if axis is Dof.X else 1 for axis, _, _ in own], dtype=np.intp)
        logs, deviations = (np.array([getattr(each, name) for _, _, each in own]) for name in ("log", "deviation"))
        known.append(KnownFactors(kind, logs, deviations, change[np.arange(rows.size), rows]))
    feeds = [cuts[id].conditions.feed_per_tooth for id in ids if id in cuts]
    return replace(changes, law=fit_law(known, campaign.coefficients, float(np.exp(np.mean(np.log(feeds))))))
