"""The service identifies a robot as the command does."""

import pytest

from api.client import Client
from tests.api.identifying import carried
from tests.api.in_process import embedded, refused, service


@pytest.mark.slow
def test_the_service_finds_what_the_command_finds(folder, robot_file, told, tmp_path):
    store = embedded(tmp_path)
    with service(store, tmp_path) as http:
        client = Client(http=http)
        client.write_robot("arm", robot_file.read_text())
        campaign = client.upload_folder(client.make_machine("M").id, folder).id
        job = client.identify_campaign(campaign, robot="arm")
        carried(store, tmp_path)
        assert client.result(job.id) == told[1].read_text(encoding="utf-8")
        assert "one of a robot" in refused(422, client.found_modes, job.id).detail
        assert "data sheet" in refused(422, client.identify_campaign, campaign, method="paper", robot="arm").detail
        refused(404, client.identify_campaign, campaign, robot="another")
    store.close()
