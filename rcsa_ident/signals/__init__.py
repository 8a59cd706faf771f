"""From recordings to cross FRFs: windows, lines, estimators, verdicts."""
