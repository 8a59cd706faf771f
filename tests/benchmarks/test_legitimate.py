from benchmarks.legitimate import _halved, _last


def test_half_as_much_is_asked_for_again_and_again():
    found = list(_halved("{} lines", 20_000, lambda count: (f"/v1/x?count={count}", None)))
    assert [each.path for each in found[:3]] == ["/v1/x?count=20000", "/v1/x?count=10000", "/v1/x?count=5000"]
    assert found[0].words == "20 000 lines"
    assert found[-1].path == "/v1/x?count=1"
    assert next(_halved("{}", 1, lambda count: ("/", {"count": count}))).body == b'{"count": 1}'


def test_what_others_need_goes_last():
    routes = [
        ("DELETE", "/v1/machines/{id}"),
        ("DELETE", "/v1/campaigns/{id}"),
        ("DELETE", "/v1/campaigns/{id}/recordings/{name}"),
        ("POST", "/v1/identifications"),
        ("GET", "/v1/machines/{id}"),
    ]
    assert sorted(routes, key=_last) == [routes[k] for k in (4, 3, 2, 1, 0)]
