"""Schemas of the TOML files over REST, and of answers that hold what was learned."""

import numpy as np

from api.schemas.campaigns import NewCampaign
from api.schemas.machines import Modes
from api.schemas.queries import Band, ToolingAdvice, ToolingLobes
from api.schemas.toolings import ToolingKeys
from api.work.tasks import modes
from rcsa_ident.dynamics.uncertain import Doubted
from rcsa_ident.io.results.drawings import known_toolings_to_json
from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of
from rcsa_ident.report.summaries import band_summary
from rcsa_ident.stability.band_shares import BandShares
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.learnt import LearnedValue
from tests.api.in_process import refused
from tests.fixtures import by_hand


def test_schemas_are_those_of_the_command(shop):
    client, _ = shop
    for name in SCHEMAS:
        assert client.schema(name) == schema_of(name)
    assert "tooling, campaign, machine, modes" in refused(404, client.schema, "result").detail


def keys(schema, place="", definitions=None):
    """Names of everything that a schema knows, with the tables around them."""
    definitions = schema.get("$defs", schema.get("definitions", {})) if definitions is None else definitions
    if "$ref" in schema:
        return keys(definitions[schema["$ref"].rpartition("/")[2]], place, definitions)
    found = set()
    for name, inner in schema.get("properties", {}).items():
        found |= {f"{place}{name}"} | keys(inner, f"{place}{name}.", definitions)
    for inner in [*schema.get("anyOf", []), *([schema["items"]] if "items" in schema else [])]:
        found |= keys(inner, place, definitions)
    if isinstance(schema.get("additionalProperties"), dict):
        found |= keys(schema["additionalProperties"], f"{place}*.", definitions)
    return found


def test_bodies_have_the_keys_of_the_files():
    """Else a file that a command reads could not be sent, or its tooling not be shown."""
    assert keys(ToolingKeys.model_json_schema()) == keys(schema_of("tooling"))
    of_file, of_body = keys(schema_of("campaign")), keys(NewCampaign.model_json_schema())
    assert "sensors.*.gain_spread_percent" in of_file
    # a file names its toolings' files; a body may hold the toolings
    assert {each for each in of_body if not each.startswith("toolings.")} == of_file - {"toolings.*"}


def test_modes_tell_what_was_learned_of_toolings(tmp_path):
    unknown = RoughUnknown("fluted_diameter", "T1", "tooling")
    known = KnownToolings((unknown,), np.array([0.03]), np.array([0.38]), np.eye(1) * 0.01, ("T1",))
    rows = (LearnedValue("fluted_diameter", ("T1",), 9.6e-3, 0.288e-3, 9.71e-3, 0.03e-3),)
    told = Modes.model_validate(modes(by_hand.result_text(tmp_path, toolings=known_toolings_to_json(known, rows))))
    (row,) = told.toolings
    assert (row.what, row.unit, row.toolings, row.hardly_taught) == ("fluted diameter", "mm", ["T1"], False)
    assert np.allclose([row.drawn, row.spread, row.found, row.deviation], [9.6, 0.288, 9.71, 0.03], rtol=1e-12)
    assert Modes.model_validate(modes(by_hand.result_text(tmp_path))).toolings == []


def test_a_band_tells_its_shares_and_its_sentence():
    shares = {Doubted.CONTACT: 0.8, Doubted.MACHINE: 0.2}
    told = Band.model_validate(band_summary(BandShares(1000.0, 0.31, shares)))
    assert [(each.of, each.share) for each in told.shares] == [("the contact of tool and holder", 0.8), ("the machine", 0.2)]
    assert told.deviation_percent == 31.0
    assert told.in_words.startswith("80 % of the band of this limit (standard deviation 31 %) is the contact")
    assert band_summary(None) is None
    for answer in (ToolingAdvice, ToolingLobes):
        assert answer.model_fields["band"].default is None
