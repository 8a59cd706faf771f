"""What a walk through the house counts: floors from the contracts, first calls alone, climbs, returns, and calls upward."""

from __future__ import annotations

import threading

import numpy as np

from benchmarks.walks import ROOT, Call, Walk, floor_of, heard, room_of, walked
from rcsa_ident.base.units import from_hz
from rcsa_ident.dynamics import receptance
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.identification.data import nodes
from rcsa_ident.signals.motion import usual_shares

ORDER = ("base", "dynamics", "signals", "setup", "machine", "identification", "workflows", "front", "cli")


def test_floors_are_those_of_the_contracts_and_the_service_stands_above():
    floors = [floor_of(f"rcsa_ident.{room}") for room in ORDER]
    assert floors == sorted(set(floors))
    assert floors[:2] == [-1, 0]
    assert floor_of("rcsa_ident.identification.coupled") == floor_of("rcsa_ident.identification")
    assert floors[-1] < floor_of("api.codec") < floor_of("api.routes") < floor_of("api.main")


def test_rooms_are_folders_and_what_all_share_is_none():
    found = {
        file: room_of(str(ROOT / file)) for file in ("rcsa_ident/identification/coupled/fit.py", "rcsa_ident/cutting/_kernels/lines.py")
    }
    assert list(found.values()) == ["rcsa_ident.identification.coupled", "rcsa_ident.cutting"]
    assert room_of(str(ROOT / "api" / "main.py")) == "api.main"
    assert {room_of(str(ROOT / file)) for file in ("rcsa_ident/base/units.py", "tests/conftest.py")} == {room_of(np.__file__)} == {""}


def test_a_function_counts_once_and_with_who_called_it():
    def asked():
        from_hz(1.0)
        nodes(np.ones((1, 2)))
        usual_shares(1)
        nodes(np.ones((1, 2)))

    with heard() as found:
        asked()
        other = threading.Thread(target=lambda: Coordinate.parse("tip.x"))
        other.start()
        other.join()
    calls = list(found.values())
    assert calls[:2] == [Call("rcsa_ident.identification", ""), Call("rcsa_ident.signals", "")]
    assert {each.room for each in calls[2:]} == {"rcsa_ident.dynamics"}
    receptance.assumed_of([])
    assert len(found) == len(calls)


def test_stops_climbs_returns_and_calls_upward():
    low, middle, high = "rcsa_ident.dynamics", "rcsa_ident.signals", "rcsa_ident.workflows"
    calls = [Call(high, ""), Call(middle, high), Call(middle, middle), Call(low, middle), Call(high, low), Call(middle, high)]

    def walk(_):
        """Here → there."""
        return calls

    found = walked(walk, ROOT, False)
    assert found == Walk("Here → there", 6, 1, (high, middle, low, high, middle))
    assert (found.rooms, found.climbs, found.returns) == (3, 1, 2)
    calls[2:3] = [Call(f"{middle}.sound", middle)]
    assert walked(walk, ROOT, False).stops == (high, middle, f"{middle}.sound", low, high, middle)
    assert walked(walk, ROOT, True) == found
