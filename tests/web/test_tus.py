"""The tus client that browsers have, as others wrote it, on a page of the service: a cut connection costs what was under way, no more."""

from __future__ import annotations

import base64
import hashlib

import pytest

from tests.api.recordings import content, declared
from tests.fixtures.paths import ROOT

TUS = (ROOT / "tests" / "fixtures" / "tus_js_client" / "tus.min.js").read_text(encoding="utf-8")
PART = 20_000
#: Upload a file and return its address, or the error that ends it; `kept` follows what an earlier page has remembered.
UPLOAD = """async ({endpoint, text, part, sha256, kept, override}) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const file = new File([bytes], 'c0_cut.h5', {lastModified: 1});
  return new Promise(async (resolve) => {
    const upload = new tus.Upload(file, {
      endpoint, chunkSize: part, retryDelays: [50, 100, 200], overridePatchMethod: override,
      metadata: {filename: file.name, sha256},
      onError: (error) => resolve(`error: ${error.message}`),
      onSuccess: () => resolve(upload.url),
    });
    const [previous] = await upload.findPreviousUploads();
    if (kept && previous) upload.resumeFromPreviousUpload(previous);
    upload.start();
  });
}"""


@pytest.mark.parametrize("kept", [True, False], ids=["address kept", "address lost"])
@pytest.mark.parametrize("override", [False, True], ids=["PATCH", "POST"])
def test_an_upload_goes_on_after_the_connection_was_cut(opened, client, tmp_path, kept, override):
    raw = content(tmp_path)
    id = client.make_campaign(client.make_machine(f"tus {kept} {override}").id, declared(2)).id
    asked = {
        "endpoint": f"/v1/campaigns/{id}/uploads",
        "text": base64.b64encode(raw).decode(),
        "part": PART,
        "sha256": hashlib.sha256(raw).hexdigest(),
        "kept": kept,
        "override": override,
    }
    page = opened()
    page.evaluate(TUS)

    def parts():
        found = [each for each in opened.watch.requests if f"{id}/uploads/" in each.url and "upload-offset" in each.headers]
        return [(int(each.headers["upload-offset"]), each.method) for each in found]

    def cut(route):
        # the fourth part finds no network any more, and neither does what follows it
        if route.request.headers.get("upload-offset") == str(3 * PART):
            page.context.set_offline(True)
        route.continue_()

    page.route(f"**/{id}/uploads/**", cut)
    assert page.evaluate(UPLOAD, asked).startswith(f"error: tus: failed to upload chunk at offset {3 * PART}")
    page.context.set_offline(False)
    page.unroute_all()
    assert client.http.head(f"{asked['endpoint']}/c0_cut.h5", headers={"Tus-Resumable": "1.0.0"}).headers["upload-offset"] == str(3 * PART)
    page.reload()
    page.evaluate(TUS)
    if not kept:
        page.evaluate("localStorage.clear()")
    before = len(parts())
    assert page.evaluate(UPLOAD, asked).endswith(f"{asked['endpoint']}/c0_cut.h5")
    assert client.recording(id, "c0_cut.h5").sha256 == asked["sha256"]
    # one that has lost the address is told at its first part where the upload stands
    begins = [] if kept else [0]
    assert [offset for offset, _ in parts()[before:]] == [*begins, *range(3 * PART, len(raw), PART)]
    assert {method for _, method in parts()} == {"POST" if override else "PATCH"}
