"""FRFs, lobes and forces as tables, and hammer tests."""
