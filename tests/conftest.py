"""What all tests share."""

import os

import pytest

# one thread per test process: small matrices gain nothing from more, and lose much where processes share the cores
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Where everything is installed that tests may want, a skip hides something: it fails."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("RCSA_IDENT_NO_SKIPS"):
        report.outcome = "failed"
        report.longrepr = f"skipped, though RCSA_IDENT_NO_SKIPS is set: {report.longrepr}"
    return report
