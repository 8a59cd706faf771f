"""Figures of receptances and recordings."""

from __future__ import annotations

import numpy as np

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.report.curves import recording_figure
from rcsa_ident.report.style import svg
from rcsa_ident.signals.recording import Quantity, Recording, Sensor


def test_a_channel_is_shown_by_its_name_letter_by_letter():
    sensor = Sensor(r"<script> $\x$", Quantity.DISPLACEMENT, Dof.X)
    text = svg(recording_figure(Recording(1000.0, np.zeros((100, 1)), (sensor,))), "r")
    assert r"&lt;script&gt; $\x$" in text
    assert "<script" not in text
