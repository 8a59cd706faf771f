"""Schemas of the TOML files over REST."""

from rcsa_ident.io.schemas import SCHEMAS, schema_of
from tests.api.in_process import refused


def test_schemas_are_those_of_the_command(shop):
    client, _ = shop
    for name in SCHEMAS:
        assert client.schema(name) == schema_of(name)
    assert "tooling, campaign, machine, modes" in refused(404, client.schema, "result").detail
